/* loop.c: a navigation system on a microcontroller. UBX-NAV-PVT of a receiver in, NMEA out.

   loop.h says what your board calls and what it has. Set what is marked SET for your vehicle.
   A fix arrives 50 to 200 ms after the instant at which it holds; strapdown_delayed takes it there. */
#include "loop.h"

#include "strapdown_delayed.h"

#include <math.h>
#include <string.h>

enum { RATE = 5 };                     /* SET: Hz of the sentences */
static const double ARM[3] = {0, 0, 0}; /* SET: m, from the IMU to the antenna: forward, right, down */
static const double MOVES = 3.0; /* SET: m/s from which on the course is taken for the heading */
static const double LEVELLED = 0.09, COURSE_STD = 0.2; /* rad: what such a start is worth */
static const double PI = 3.141592653589793, DAY = 86400.0, WEEK = 604800.0;

/* ---- what a receiver says: UBX-NAV-PVT ---- */

enum { HEAD = 6, PVT = 92, FRAME = HEAD + PVT + 2 };

typedef struct {
    double t, utc;                /* s: GPS time of week; UTC since midnight */
    int day, month, year;
    int timed, fixed;             /* 1: time and date are valid; it has a fix */
    double lla[3], v[3];          /* rad, rad, m above the ellipsoid; m/s NED */
    double position_std[3], speed_std;
    double above_geoid;           /* m */
} pvt_fix;

static int32_t number(const uint8_t *bytes, int count)
{
    uint32_t made = 0;
    for (int i = count - 1; i >= 0; i--)
        made = made << 8 | bytes[i];
    return (int32_t)made;
}

static void read_pvt(const uint8_t *p, pvt_fix *fix)
{
    fix->t = (uint32_t)number(p, 4) * 1e-3;
    fix->year = number(p + 4, 2);
    fix->month = p[6];
    fix->day = p[7];
    fix->utc = p[8] * 3600.0 + p[9] * 60.0 + p[10] + number(p + 16, 4) * 1e-9;
    fix->timed = (p[11] & 3) == 3;
    fix->fixed = (p[20] == 3 || p[20] == 4) && (p[21] & 1) && !(p[78] & 1);
    fix->lla[1] = number(p + 24, 4) * 1e-7 * PI / 180;
    fix->lla[0] = number(p + 28, 4) * 1e-7 * PI / 180;
    fix->lla[2] = number(p + 32, 4) * 1e-3;
    fix->above_geoid = number(p + 36, 4) * 1e-3;
    /* each accuracy stands for each of its axes, as strapdown reads logs */
    fix->position_std[0] = fix->position_std[1] = (uint32_t)number(p + 40, 4) * 1e-3;
    fix->position_std[2] = (uint32_t)number(p + 44, 4) * 1e-3;
    for (int i = 0; i < 3; i++)
        fix->v[i] = number(p + 48 + 4 * i, 4) * 1e-3;
    fix->speed_std = (uint32_t)number(p + 68, 4) * 1e-3;
}

/* 1: a NAV-PVT may begin with these bytes. */
static int may_begin(const uint8_t *bytes, int count)
{
    static const uint8_t begins[HEAD] = {0xb5, 0x62, 0x01, 0x07, PVT, 0};
    return memcmp(bytes, begins, (size_t)(count < HEAD ? count : HEAD)) == 0;
}

/* 1: the checksum of a frame is that of its bytes. */
static int whole(const uint8_t *frame)
{
    uint8_t a = 0, b = 0;
    for (int i = 2; i < HEAD + PVT; i++) {
        a = (uint8_t)(a + frame[i]);
        b = (uint8_t)(b + a);
    }
    return a == frame[HEAD + PVT] && b == frame[HEAD + PVT + 1];
}

/* One byte more; 1 where it ends a whole NAV-PVT, which is then in `fix`. */
static int read_byte(uint8_t byte, pvt_fix *fix)
{
    static uint8_t frame[FRAME];
    static int count;
    frame[count++] = byte;
    if (count == FRAME && whole(frame)) {
        count = 0;
        read_pvt(frame + HEAD, fix);
        return 1;
    }
    /* where bytes were lost, the next message may have begun among those that are here */
    while (count == FRAME || !may_begin(frame, count)) {
        count--;
        memmove(frame, frame + 1, (size_t)count);
    }
    return 0;
}

/* ---- what goes out: NMEA ---- */

typedef struct {
    char text[100];
    int length;
} sentence;

static void put_one(sentence *s, char one)
{
    if (s->length < (int)sizeof s->text)
        s->text[s->length++] = one;
}

static void put(sentence *s, const char *text)
{
    while (*text)
        put_one(s, *text++);
}

/* A number with so many digits before and after the point, without printf, which is large. What is
   no number, or beyond any vehicle, is left out. */
static void put_number(sentence *s, double value, int before, int after)
{
    int64_t scale = 1;
    char digits[24];
    int count = 0;
    if (!(fabs(value) < 1e9))
        return;
    for (int i = 0; i < after; i++)
        scale *= 10;
    int64_t rounded = (int64_t)floor(fabs(value) * (double)scale + 0.5);
    if (value < 0 && rounded > 0)
        put_one(s, '-');
    while (count < before + after || rounded > 0) {
        digits[count++] = (char)('0' + rounded % 10);
        rounded /= 10;
    }
    while (count > 0) {
        if (count == after)
            put_one(s, '.');
        put_one(s, digits[--count]);
    }
}

/* Degrees and minutes of an angle, and its half of the Earth. */
static void put_angle(
    sentence *s, double angle, int digits, const char *positive, const char *negative)
{
    double minutes = floor(fabs(angle) * 180 / PI * 60 * 1e5 + 0.5) / 1e5;
    double degrees = floor(minutes / 60);
    put(s, ",");
    put_number(s, degrees, digits, 0);
    put_number(s, minutes - 60 * degrees, 2, 5);
    put(s, ",");
    put(s, angle < 0 ? negative : positive);
}

static void put_time(sentence *s, double utc)
{
    double hundredths = floor(fmod(utc + DAY, DAY) * 100 + 0.5);
    double seconds = fmod(floor(hundredths / 100), DAY);
    put_number(s, floor(seconds / 3600), 2, 0);
    put_number(s, floor(fmod(seconds, 3600) / 60), 2, 0);
    put_number(s, fmod(seconds, 60) + fmod(hundredths, 100) / 100, 2, 2);
}

static void send(sentence *s)
{
    static const char hex[] = "0123456789ABCDEF";
    uint8_t sum = 0;
    for (int i = 1; i < s->length; i++)
        sum ^= (uint8_t)s->text[i];
    for (int i = 0; i < s->length; i++)
        board_write(s->text[i]);
    board_write('*');
    board_write(hex[sum >> 4]);
    board_write(hex[sum & 15]);
    board_write('\r');
    board_write('\n');
    s->length = 0;
}

static void put_place(sentence *s, const double *lla)
{
    put_angle(s, lla[0], 2, "N", "S");
    put_angle(s, lla[1], 3, "E", "W");
}

/* quality: 0 not to be used, 1 with GNSS, 6 by dead reckoning */
static void send_gga(const double *row, double utc, const pvt_fix *last, int quality)
{
    sentence s = {.length = 0};
    double geoid = last->lla[2] - last->above_geoid;
    put(&s, "$GPGGA,");
    put_time(&s, utc);
    put_place(&s, row + STRAPDOWN_ROW_LLA);
    put(&s, ",");
    put_number(&s, quality, 1, 0);
    put(&s, ",,,");
    put_number(&s, row[STRAPDOWN_ROW_LLA + 2] - geoid, 1, 3);
    put(&s, ",M,");
    put_number(&s, geoid, 1, 3);
    put(&s, ",M,,");
    send(&s);
}

static void send_rmc(const double *row, double utc, const pvt_fix *last, int quality)
{
    sentence s = {.length = 0};
    const double *v = row + STRAPDOWN_ROW_V;
    double course = atan2(v[1], v[0]) * 180 / PI;
    put(&s, "$GPRMC,");
    put_time(&s, utc);
    put(&s, quality ? ",A" : ",V");
    put_place(&s, row + STRAPDOWN_ROW_LLA);
    put(&s, ",");
    put_number(&s, hypot(v[0], v[1]) * 3600 / 1852, 1, 3);
    put(&s, ",");
    put_number(&s, fmod(floor((course + 360) * 100 + 0.5), 36000) / 100, 1, 2);
    put(&s, ",");
    if (utc >= 0 && utc < DAY) { /* without fixes since midnight the date is left out */
        put_number(&s, last->day, 2, 0);
        put_number(&s, last->month, 2, 0);
        put_number(&s, last->year % 100, 2, 0);
    }
    put(&s, ",,,");
    put(&s, quality == 6 ? "E" : quality ? "A" : "N");
    send(&s);
}

/* ---- GPS time of your board's clock ---- */

static double now;        /* s of the clock: the end of the last sample */
static double pulse;      /* s of the clock: the last pulse; used: see below */
static int pulsed, timed; /* 1: there was a pulse since the last fix; GPS time is known */
static double ahead;      /* s: GPS time of week less the clock; it goes on beyond the end of a week */
static double other;      /* s: the same of a pulse that did not agree with it */

void loop_pulse(double clock)
{
    pulse = clock;
    pulsed = 1;
}

/* Tie the clock to GPS time at the first message after a pulse: that second began with the pulse. */
static void keep_time(const pvt_fix *fix)
{
    double since = now - pulse, second = floor(fix->t - since + 0.75), found = second - pulse;
    if (!pulsed || !fix->timed)
        return;
    pulsed = 0;
    if (!(since >= -0.1 && since < 1.1))
        return;
    /* a pulse that is off counts if the next one says the same */
    if (!timed || fabs(found - ahead) < 1e-3 || fabs(found - other) < 1e-3) {
        ahead = found;
        timed = 1;
    }
    other = found;
}

/* ---- the loop ---- */

static strapdown_delayed nav;
static int runs;               /* 1: the filter has begun */
static pvt_fix last;           /* of the receiver */
static double taken;           /* s: when the last fix holds that the filter was given */
static double force[3], spent; /* m/s, s: specific force summed up to begin with */
static double said;            /* when a sentence was sent last, in 1 / RATE s */
static int place;              /* where the state is saved next */

/* Begin at a fix: level by the specific force, heading by the course. */
static void begin(const pvt_fix *fix)
{
    strapdown_values values = strapdown_example; /* noise of the IMU, biases and their deviations */
    double parameters[STRAPDOWN_PARAMETERS] = {ARM[0], ARM[1], ARM[2]};
    double length = sqrt(ARM[0] * ARM[0] + ARM[1] * ARM[1] + ARM[2] * ARM[2]);
    double down = sqrt(force[1] * force[1] + force[2] * force[2]);
    values.t = fix->t;
    values.rph[0] = atan2(-force[1], -force[2]);
    values.rph[1] = atan2(force[0], down);
    values.rph[2] = atan2(fix->v[1], fix->v[0]);
    for (int i = 0; i < 3; i++) {
        values.lla[i] = fix->lla[i];
        values.v_n[i] = fix->v[i];
        values.std[i] = hypot(fix->position_std[i], length); /* the IMU is not at the antenna */
        values.std[3 + i] = fix->speed_std;
        values.std[6 + i] = i < 2 ? LEVELLED : COURSE_STD;
    }
    runs = strapdown_start(&nav.newest, &values) == STRAPDOWN_OK;
    taken = fix->t;
    strapdown_source(&nav.newest, STRAPDOWN_SOURCE_POSITION, parameters, 0);
    strapdown_source(&nav.newest, STRAPDOWN_SOURCE_VELOCITY, parameters, 0);
    strapdown_delay(&nav, &nav.newest);
}

static void send_newest(double t)
{
    const double *row = nav.newest.out.nav[0];
    double due = floor(t * RATE + 0.01), utc = last.utc + (t - last.t);
    int used = row[STRAPDOWN_ROW_STATUS] <= STRAPDOWN_BRIDGED;
    int quality = !used ? 0 : t - taken < 2.0 ? 1 : 6;
    /* after a restart UTC and the geoid are those of the next fix */
    if (due == said || !last.fixed)
        return;
    said = due;
    send_gga(row, utc, &last, quality);
    send_rmc(row, utc, &last, quality);
}

void loop_sample(double clock, double dt, const double dtheta[3], const double dv[3])
{
    if (!isfinite(clock))
        return;
    now = clock;
    if (!runs) {
        spent += dt;
        for (int i = 0; i < 3; i++)
            force[i] += dv[i];
    }
    if (!runs || !timed)
        return;
    double t = clock + ahead, late = nav.newest.late;
    int status = strapdown_delayed_sample(&nav, t, dt, dtheta, dv);
    /* where it cannot go on, it begins again at the next fix */
    if (status == STRAPDOWN_STOPPED || status == STRAPDOWN_JUMP
        || (status == STRAPDOWN_LATE && t < late - 1.0))
        runs = 0;
    else if (status >= 0)
        send_newest(t);
}

static void take_fix(const pvt_fix *fix)
{
    double speed_std[3] = {fix->speed_std, fix->speed_std, fix->speed_std};
    last = *fix;
    if (runs) {
        if (strapdown_delayed_fix(
                &nav, STRAPDOWN_SOURCE_POSITION, fix->t, fix->lla, fix->position_std)
            == STRAPDOWN_OK)
            taken = fix->t;
        strapdown_delayed_fix(&nav, STRAPDOWN_SOURCE_VELOCITY, fix->t, fix->v, speed_std);
    } else if (!(spent <= 0.15)) {
        if (hypot(fix->v[0], fix->v[1]) > MOVES)
            begin(fix);
        spent = force[0] = force[1] = force[2] = 0.0;
    }
}

void loop_byte(uint8_t byte)
{
    pvt_fix fix;
    if (!read_byte(byte, &fix))
        return;
    /* the time of week began again since, perhaps while the power was off */
    double newest = timed ? now + ahead : runs ? nav.newest.late : 0.0;
    while (fix.t < newest - WEEK / 2)
        fix.t += WEEK;
    keep_time(&fix);
    /* a fix far from the samples is of another time than theirs; one may come twice */
    if (timed && fix.fixed && fabs(fix.t - now - ahead) < 2.0 && fix.t != last.t)
        take_fix(&fix);
}

void loop_start(void)
{
    for (int i = 0; i < 2; i++) {
        const strapdown_saved *saved = board_saved(i);
        if (saved && (!runs || saved->filter.late > nav.newest.late)
            && strapdown_restore(&nav.newest, saved) == STRAPDOWN_OK) {
            runs = 1;
            place = 1 - i;
        }
    }
    if (runs)
        strapdown_delay(&nav, &nav.newest);
}

void loop_save(void)
{
    static strapdown_saved saved;
    if (!runs)
        return;
    strapdown_delayed_catch_up(&nav);
    strapdown_save(&saved, &nav.newest);
    board_save(place, &saved);
    place = 1 - place;
}
