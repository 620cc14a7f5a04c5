/* strapdown_calls.c: the functions of strapdown.h around strapdown.o.

   Made by `strapdown export`. The filter and its loop are in strapdown.o; here a filter is given its
   first values, and samples and fixes are laid where the loop finds them. C99. */
#include "strapdown.h"

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* What latitudes and samples can be. */
static const double MOST_LATITUDE = $most_latitude;
static const double LONGEST_SAMPLE = $longest_sample, LONGEST_GAP = $longest_gap;
/* s: times this close are the same */
static const double SAME_TIME = $same_time;
/* s within which what happens again is the same event */
static const double SAME_EVENT = $same_event;

const strapdown_values strapdown_example = {
$example
};

/* The bits of infinity, and of what is not a number. */
static const union { uint64_t bits; double number; } INFINITE = {UINT64_C(0x7ff0000000000000)};
static const union { uint64_t bits; double number; } NOT_MEASURED = {UINT64_C(0x7ff8000000000000)};

/* Of what is saved: strapdown.o and strapdown.h. */
static const uint64_t FORMAT = UINT64_C($format);

/* Numbers of a fix, by source. */
static const int COMPONENTS[STRAPDOWN_SOURCES] = {$components};

static int finite(double x)
{
    return x - x == 0.0;
}

static int all_finite(const double *numbers, int count)
{
    for (int i = 0; i < count; i++) {
        if (!finite(numbers[i]))
            return 0;
    }
    return 1;
}

static void copy(double *into, const double *from, int count)
{
    for (int i = 0; i < count; i++)
        into[i] = from[i];
}

static int possible(const strapdown_values *values)
{
    const double *std = values->std;
    if (!finite(values->t) || !all_finite(values->lla, 3) || !all_finite(values->v_n, 3)
        || !all_finite(values->rph, 3) || !all_finite(values->b_a, 3) || !all_finite(values->b_g, 3)
        || !all_finite(std, 15))
        return 0;
    if (!(values->lla[0] <= MOST_LATITUDE && values->lla[0] >= -MOST_LATITUDE))
        return 0;
    for (int i = 0; i < 15; i++) {
        if (std[i] < 0)
            return 0;
    }
$noise_possible
    return 1;
}

int strapdown_start(strapdown_filter *filter, const strapdown_values *values)
{
    double C[9], variance[15];
    if (!possible(values))
        return STRAPDOWN_BAD_NUMBER;
$fixed    for (int i = 0; i < 15; i++)
        variance[i] = values->std[i] * values->std[i];
    strapdown_attitude(values->rph, C);

    unsigned char *bytes = (unsigned char *)filter;
    for (uint32_t i = 0; i < sizeof *filter; i++)
        bytes[i] = 0;

    /* What is the same of every start. */
$constants

    /* What is of this one. */
$copies

    filter->late = filter->late_fix = values->t + SAME_TIME;
    return STRAPDOWN_OK;
}

int strapdown_source(strapdown_filter *filter, int source, const double *parameters, double gate)
{
    if (source < 0 || source >= STRAPDOWN_SOURCES)
        return STRAPDOWN_NO_SOURCE;
    if (gate != gate || (parameters && !all_finite(parameters, STRAPDOWN_PARAMETERS)))
        return STRAPDOWN_BAD_NUMBER;
    if (parameters)
        copy(filter->fixes.sources[source].parameters, parameters, STRAPDOWN_PARAMETERS);
    if (gate > 0)
        filter->fixes.sources[source].gate = gate;
    return STRAPDOWN_OK;
}

int strapdown_fix(
    strapdown_filter *filter, int source, double t, const double *y, const double *std)
{
    strapdown_loop_state_row *state = &filter->cursor.state;
    int64_t row = state->fixes;
    int measured = 0;
    if (source < 0 || source >= STRAPDOWN_SOURCES)
        return STRAPDOWN_NO_SOURCE;
    for (int i = 0; i < COMPONENTS[source]; i++) {
        if (finite(y[i])) {
            measured++;
            if (!(finite(std[i]) && std[i] > 0))
                return STRAPDOWN_BAD_NUMBER;
        }
    }
    if (!finite(t) || !measured)
        return STRAPDOWN_BAD_NUMBER;
    if (!(t > filter->late_fix))
        return STRAPDOWN_LATE;
    if (row == STRAPDOWN_WAITING)
        return STRAPDOWN_FULL;

    /* In the order of time, at the same time in that of the sources. */
    while (row > 0
           && (t < filter->fixes.t[row - 1]
               || (t == filter->fixes.t[row - 1] && source < filter->fixes.source[row - 1]))) {
        filter->fixes.t[row] = filter->fixes.t[row - 1];
        filter->fixes.source[row] = filter->fixes.source[row - 1];
        copy(filter->fixes.y[row], filter->fixes.y[row - 1], 3);
        copy(filter->fixes.std[row], filter->fixes.std[row - 1], 3);
        row--;
    }
    filter->fixes.t[row] = t;
    filter->fixes.source[row] = source;
    for (int i = 0; i < 3; i++) {
        int there = i < COMPONENTS[source];
        filter->fixes.y[row][i] = there && finite(y[i]) ? y[i] : NOT_MEASURED.number;
        filter->fixes.std[row][i] = there ? std[i] : NOT_MEASURED.number;
    }
    state->fixes++;
    return STRAPDOWN_OK;
}

int strapdown_sample(
    strapdown_filter *filter, double t, double dt, const double dtheta[3], const double dv[3])
{
    strapdown_loop_state_row *state = &filter->cursor.state;
    if (state->fault)
        return STRAPDOWN_STOPPED;
    if (!finite(t) || !(dt > 0 && dt <= LONGEST_SAMPLE) || !all_finite(dtheta, 3)
        || !all_finite(dv, 3))
        return STRAPDOWN_BAD_NUMBER;
    if (!(t > filter->late))
        return STRAPDOWN_LATE;
    if (t - filter->late > LONGEST_GAP)
        return STRAPDOWN_JUMP;

    filter->imu.t[0] = t;
    filter->imu.dt[0] = dt;
    copy(filter->imu.dtheta[0], dtheta, 3);
    copy(filter->imu.dv[0], dv, 3);
    state->row = state->out = state->fix = 0;
    state->stop = 1;
    strapdown_run(filter);

    /* The fixes that still wait move up. */
    int64_t used = state->fix, waiting = state->fixes - used;
    for (int64_t row = 0; used > 0 && row < waiting; row++) {
        filter->fixes.t[row] = filter->fixes.t[row + used];
        filter->fixes.source[row] = filter->fixes.source[row + used];
        copy(filter->fixes.y[row], filter->fixes.y[row + used], 3);
        copy(filter->fixes.std[row], filter->fixes.std[row + used], 3);
    }
    state->fixes = waiting;
    filter->used = used;
    filter->late = t;
    filter->late_fix = t - SAME_TIME;
    return state->fault ? STRAPDOWN_STOPPED : (int)state->shown;
}

/* Leave a row of the log. */
static void forget(strapdown_filter *filter, int64_t row)
{
    strapdown_log_row *log = filter->cursor.log;
    int64_t rows = --filter->cursor.state.logged;
    filter->told--;
    for (; row < rows; row++)
        log[row] = log[row + 1];
}

int strapdown_next_event(strapdown_filter *filter, strapdown_event *event)
{
    const strapdown_log_row *log = filter->cursor.log;
    const int64_t *logged = &filter->cursor.state.logged;
    /* Rows that were told stay as long as the same again would be the same event, and there is room. */
    for (int64_t row = filter->told - 1; row >= 0; row--) {
        if (filter->late - log[row].until > SAME_EVENT)
            forget(filter, row);
    }
    while (filter->told > 0 && *logged >= STRAPDOWN_LOG_ROWS - 1)
        forget(filter, 0);
    if (filter->told == *logged)
        return 0;
    const strapdown_log_row *row = &log[filter->told++];
    event->t = row->t;
    event->code = (int)row->code;
    event->which = (int)row->which;
    event->value = row->value;
    return 1;
}

/* FNV-1a. */
static uint64_t checksum(const strapdown_filter *filter)
{
    const unsigned char *bytes = (const unsigned char *)filter;
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (uint32_t i = 0; i < sizeof *filter; i++)
        sum = (sum ^ bytes[i]) * UINT64_C(0x100000001b3);
    return sum;
}

void strapdown_save(strapdown_saved *saved, const strapdown_filter *filter)
{
    saved->format = FORMAT;
    saved->checksum = checksum(filter);
    saved->filter = *filter;
}

int strapdown_restore(strapdown_filter *filter, const strapdown_saved *saved)
{
    if (saved->format != FORMAT || saved->checksum != checksum(&saved->filter))
        return STRAPDOWN_NOT_SAVED;
    *filter = saved->filter;
    return filter->cursor.state.fault ? STRAPDOWN_STOPPED : STRAPDOWN_OK;
}
