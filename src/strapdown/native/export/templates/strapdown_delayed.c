/* strapdown_delayed.c: the functions of strapdown_delayed.h. C99. */
#include "strapdown_delayed.h"

static int take(strapdown_filter *filter, const strapdown_kept_sample *sample)
{
    return strapdown_sample(filter, sample->t, sample->dt, sample->dtheta, sample->dv);
}

static strapdown_kept_sample *kept(strapdown_delayed *delayed, int i)
{
    return &delayed->samples[(delayed->first + i) % STRAPDOWN_KEPT];
}

/* Let the oldest sample go. */
static void settle(strapdown_delayed *delayed)
{
    take(&delayed->settled, kept(delayed, 0));
    delayed->first = (delayed->first + 1) % STRAPDOWN_KEPT;
    delayed->count--;
}

void strapdown_delay(strapdown_delayed *delayed, const strapdown_filter *filter)
{
    delayed->settled = delayed->newest = *filter;
    delayed->first = delayed->count = delayed->behind = 0;
}

void strapdown_delayed_catch_up(strapdown_delayed *delayed)
{
    if (!delayed->behind)
        return;
    delayed->newest = delayed->settled;
    for (int i = 0; i < delayed->count; i++)
        take(&delayed->newest, kept(delayed, i));
    delayed->behind = 0;
}

int strapdown_delayed_sample(
    strapdown_delayed *delayed, double t, double dt, const double dtheta[3], const double dv[3])
{
    strapdown_delayed_catch_up(delayed);
    int status = strapdown_sample(&delayed->newest, t, dt, dtheta, dv);
    if (status < 0)
        return status;
    if (delayed->count == STRAPDOWN_KEPT)
        settle(delayed);
    strapdown_kept_sample *sample = kept(delayed, delayed->count++);
    sample->t = t;
    sample->dt = dt;
    for (int i = 0; i < 3; i++) {
        sample->dtheta[i] = dtheta[i];
        sample->dv[i] = dv[i];
    }
    return status;
}

int strapdown_delayed_fix(
    strapdown_delayed *delayed, int source, double t, const double *y, const double *std)
{
    /* a sample uses the fixes up to its time, and as much beyond as counts as the same time */
    double used = delayed->newest.late;
    int late = !(t > used + (used - delayed->newest.late_fix)), result;
    while ((result = strapdown_fix(&delayed->settled, source, t, y, std)) == STRAPDOWN_FULL
           && delayed->count > 0)
        settle(delayed);
    if (result < 0)
        return result;
    if (!late)
        return strapdown_fix(&delayed->newest, source, t, y, std);
    delayed->behind = 1;
    return result;
}
