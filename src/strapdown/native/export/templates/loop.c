/* loop.c: a navigation system on a microcontroller. UBX-NAV-PVT of a receiver in, NMEA out.

   Your board calls two functions: on_sample from the IMU's interrupt or task, on_byte with what the
   receiver's port reads; and it gives one: write_byte. Samples are stamped in GPS time since the
   beginning of the week in which the board started, as a timer has it that the receiver's pulse per
   second sets. A fix arrives 50 to 200 ms after the instant
   at which it holds; strapdown_delayed takes it there.

   Compiled with -DON_A_DESK it reads a recorded stream from standard input and writes to standard
   output. */
#include "strapdown_delayed.h"

#include <math.h>
#include <string.h>

enum { RATE = 5 }; /* Hz of the sentences */
static const double PI = 3.141592653589793, DAY = 86400.0, WEEK = 604800.0;
static const double MOVES = 3.0; /* m/s from which on the course is taken for the heading */
static const double LEVELLED = 0.09, COURSE_STD = 0.2; /* rad: what such a start is worth */

void write_byte(char byte);

/* ---- what a receiver says: UBX-NAV-PVT ---- */

enum { HEAD = 6, PVT = 92 };

typedef struct {
    double t, utc;                /* s: GPS time as of samples; UTC since midnight */
    int day, month, year;
    int fixed;                    /* 1: it has a fix */
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
    fix->fixed = (p[20] == 3 || p[20] == 4) && (p[21] & 1);
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

/* One byte more; 1 where it ends a whole NAV-PVT, which is then in `fix`. */
static int read_byte(uint8_t byte, pvt_fix *fix)
{
    static uint8_t frame[HEAD + PVT + 2];
    static int count;
    static const uint8_t begins[HEAD] = {0xb5, 0x62, 0x01, 0x07, PVT, 0};
    frame[count++] = byte;
    if (count <= HEAD && byte != begins[count - 1]) {
        frame[0] = byte; /* it may begin the next message */
        count = byte == begins[0];
    }
    if (count < HEAD + PVT + 2)
        return 0;
    count = 0;
    uint8_t a = 0, b = 0;
    for (int i = 2; i < HEAD + PVT; i++) {
        a = (uint8_t)(a + frame[i]);
        b = (uint8_t)(b + a);
    }
    if (a != frame[HEAD + PVT] || b != frame[HEAD + PVT + 1])
        return 0;
    read_pvt(frame + HEAD, fix);
    return 1;
}

/* ---- what goes out: NMEA ---- */

typedef struct {
    char text[100];
    int length;
} sentence;

static void put(sentence *s, const char *text)
{
    while (*text)
        s->text[s->length++] = *text++;
}

/* A number with so many digits before and after the point, without printf, which is large. */
static void put_number(sentence *s, double value, int before, int after)
{
    int64_t scale = 1;
    char digits[24];
    int count = 0;
    for (int i = 0; i < after; i++)
        scale *= 10;
    int64_t whole = (int64_t)floor(fabs(value) * (double)scale + 0.5);
    if (value < 0 && whole > 0)
        put(s, "-");
    while (count < before + after || whole > 0) {
        digits[count++] = (char)('0' + whole % 10);
        whole /= 10;
    }
    while (count > 0) {
        if (count == after)
            s->text[s->length++] = '.';
        s->text[s->length++] = digits[--count];
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
    double hundredths = floor(fmod(utc, DAY) * 100 + 0.5), seconds = floor(hundredths / 100);
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
        write_byte(s->text[i]);
    write_byte('*');
    write_byte(hex[sum >> 4]);
    write_byte(hex[sum & 15]);
    write_byte('\r');
    write_byte('\n');
    s->length = 0;
}

static void send_row(const double *row, double utc, const pvt_fix *last)
{
    sentence s = {.length = 0};
    const double *lla = row + STRAPDOWN_ROW_LLA, *v = row + STRAPDOWN_ROW_V;
    double geoid = last->lla[2] - last->above_geoid, course = atan2(v[1], v[0]) * 180 / PI;
    /* 1: with GNSS; 6: by dead reckoning */
    int counts = row[STRAPDOWN_ROW_STATUS] <= STRAPDOWN_BRIDGED;
    int quality = !counts ? 0 : row[STRAPDOWN_ROW_T] - last->t < 2.0 ? 1 : 6;
    put(&s, "$GPGGA,");
    put_time(&s, utc);
    put_angle(&s, lla[0], 2, "N", "S");
    put_angle(&s, lla[1], 3, "E", "W");
    put(&s, ",");
    put_number(&s, quality, 1, 0);
    put(&s, ",,,");
    put_number(&s, lla[2] - geoid, 1, 3);
    put(&s, ",M,");
    put_number(&s, geoid, 1, 3);
    put(&s, ",M,,");
    send(&s);
    put(&s, "$GPRMC,");
    put_time(&s, utc);
    put(&s, counts ? ",A" : ",V");
    put_angle(&s, lla[0], 2, "N", "S");
    put_angle(&s, lla[1], 3, "E", "W");
    put(&s, ",");
    put_number(&s, hypot(v[0], v[1]) * 3600 / 1852, 1, 3);
    put(&s, ",");
    put_number(&s, course < 0 ? course + 360 : course, 1, 2);
    put(&s, ",");
    if (utc < DAY) { /* without fixes since midnight the date is left out */
        put_number(&s, last->day, 2, 0);
        put_number(&s, last->month, 2, 0);
        put_number(&s, last->year % 100, 2, 0);
    }
    put(&s, ",,,");
    put(&s, quality == 6 ? "E" : quality ? "A" : "N");
    send(&s);
}

/* ---- the loop ---- */

static strapdown_delayed nav;
static int runs;               /* 1: the filter has begun */
static pvt_fix last;           /* of the receiver */
static double force[3], spent; /* m/s, s: specific force summed up since the last fix */
static double said;            /* s: when a sentence was sent last */

/* Begin at a fix: level by the specific force since the fix before, heading by the course. */
static void begin(const pvt_fix *fix)
{
    strapdown_values values = strapdown_example; /* noise of the IMU, biases and their deviations */
    double down = sqrt(force[1] * force[1] + force[2] * force[2]);
    values.t = fix->t;
    values.rph[0] = atan2(-force[1], -force[2]);
    values.rph[1] = atan2(force[0], down);
    values.rph[2] = atan2(fix->v[1], fix->v[0]);
    for (int i = 0; i < 3; i++) {
        values.lla[i] = fix->lla[i];
        values.v_n[i] = fix->v[i];
        values.std[i] = fix->position_std[i];
        values.std[3 + i] = fix->speed_std;
        values.std[6 + i] = i < 2 ? LEVELLED : COURSE_STD;
    }
    static strapdown_filter filter;
    runs = strapdown_start(&filter, &values) == STRAPDOWN_OK;
    strapdown_delay(&nav, &filter);
}

void on_sample(double t, double dt, const double dtheta[3], const double dv[3])
{
    if (!runs) {
        spent += dt;
        for (int i = 0; i < 3; i++)
            force[i] += dv[i];
        return;
    }
    if (strapdown_delayed_sample(&nav, t, dt, dtheta, dv) == STRAPDOWN_STOPPED)
        runs = 0; /* begins again at the next fix */
    if (runs && t - said > 1.0 / RATE - 1e-3) {
        said = t;
        send_row(nav.newest.out.nav[0], last.utc + (t - last.t), &last);
    }
}

void on_byte(uint8_t byte)
{
    pvt_fix fix;
    if (!read_byte(byte, &fix) || !fix.fixed)
        return;
    while (fix.t < last.t - WEEK / 2) /* its time of week began again */
        fix.t += WEEK;
    last = fix;
    if (runs) {
        double speed_std[3] = {fix.speed_std, fix.speed_std, fix.speed_std};
        strapdown_delayed_fix(&nav, STRAPDOWN_SOURCE_POSITION, fix.t, fix.lla, fix.position_std);
        strapdown_delayed_fix(&nav, STRAPDOWN_SOURCE_VELOCITY, fix.t, fix.v, speed_std);
    } else {
        if (spent > 0.15 && hypot(fix.v[0], fix.v[1]) > MOVES)
            begin(&fix);
        spent = force[0] = force[1] = force[2] = 0.0;
    }
}

#ifdef ON_A_DESK
#include <stdio.h>

void write_byte(char byte)
{
    putchar(byte);
}

/* 'S' and eight doubles for a sample, 'B' and a byte of the receiver, in the order of arrival. */
int main(void)
{
    int kind;
    double n[8];
    while ((kind = getchar()) != EOF) {
        if (kind == 'B')
            on_byte((uint8_t)getchar());
        else if (kind == 'S' && fread(n, sizeof n, 1, stdin) == 1)
            on_sample(n[0], n[1], n + 2, n + 5);
        else
            return 1;
    }
    return 0;
}
#endif
