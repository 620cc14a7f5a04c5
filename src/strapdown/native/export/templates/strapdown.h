/* strapdown.h: the navigation filter "$filter".
   Its sources: $sources.

   Made by `strapdown export`, from the fields that the code in strapdown.o was compiled for: the
   two belong together. Everything is in SI units, radians and seconds. The body frame is forward,
   right, down; the navigation frame north, east, down at the IMU. Matrices are stored by rows.

   No function allocates, waits, reads a file or keeps anything outside the struct that it is given:
   a filter may be copied, saved and gone on with, and several run beside each other. */
#ifndef STRAPDOWN_H
#define STRAPDOWN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes. */
enum {
$sizes
};

#define STRAPDOWN_FILTER "$filter"

$enums

/* What the filter assumes of the IMU, per axis, in root densities. */
typedef struct {
$noise
} strapdown_noise;

$rows

/* Where a filter begins. */
typedef struct {
    /* time, s: of the same clock as samples and fixes */
    double t;
    /* latitude rad, longitude rad, height above the ellipsoid m, of the IMU */
    double lla[3];
    /* velocity north, east, down, m/s */
    double v_n[3];
    /* roll, pitch, heading, rad; heading is clockwise from true north */
    double rph[3];
    /* accelerometer bias, body, m/s^2 */
    double b_a[3];
    /* gyro bias, body, rad/s */
    double b_g[3];
    /* standard deviations: position m NED, velocity m/s NED, attitude rad about north, east, down,
       accelerometer bias m/s^2, gyro bias rad/s */
    double std[15];
    /* noise of the IMU */
    strapdown_noise noise;
} strapdown_values;

/* A filter: all that it knows. Read what you like; the functions below write it. */
typedef struct {
$records
    /* time up to which samples were used, s */
    double late;
    /* time up to which fixes are too late, s */
    double late_fix;
    /* rows of out.fix that are of the last sample */
    int64_t used;
    /* rows of the log that were told */
    int64_t told;
} strapdown_filter;

/* An event, when it begins. */
typedef struct {
    /* time, s */
    double t;
    /* see strapdown_code */
    int code;
    /* source, axis or condition that it is about */
    int which;
    /* how large */
    double value;
} strapdown_event;

/* A filter in memory that outlives a restart, such as flash. */
typedef struct {
    /* of the object and the header that it belongs to */
    uint64_t format;
    /* of the bytes of the filter */
    uint64_t checksum;
    strapdown_filter filter;
} strapdown_saved;

/* Values to begin with: those of the recording that replay.bin holds, with the noise of its IMU. */
extern const strapdown_values strapdown_example;

/* Begin. Values must be finite, standard deviations 0 or more and the latitude at most 89 deg. */
int strapdown_start(strapdown_filter *filter, const strapdown_values *values);

/* Set the parameters (STRAPDOWN_PARAMETERS numbers, see strapdown_source_index; null: leave them)
   and the gate of a source, after strapdown_start. A gate is the largest normalised innovation
   squared that is used: 10.8, 13.8 or 16.3 for 1, 2 or 3 components (the default) reject one right
   fix in 1000; infinity rejects none; 0 or less leaves it. */
int strapdown_source(strapdown_filter *filter, int source, const double *parameters, double gate);

/* Hand in a fix of a source that holds at t, s: y and std as strapdown_source_index says, NaN in y
   where nothing was measured. It is used with the sample that reaches its time, so it must come
   before that sample; else the result is STRAPDOWN_LATE and it is not used. */
int strapdown_fix(
    strapdown_filter *filter, int source, double t, const double *y, const double *std);

/* Use a sample of the IMU, which ends at t and lasts dt, s: the integrals over it of the angular
   rate, rad, and of the specific force, m/s, body. Of a sensor that reports rates: times dt. Then
   out.nav[0] is the solution at t and out.fix[0] to out.fix[used - 1] tell of the fixes.
   Returns a strapdown_status, or below 0 a strapdown_result. */
int strapdown_sample(
    strapdown_filter *filter, double t, double dt, const double dtheta[3], const double dv[3]);

/* The next event that has begun since it was asked last; what happens again within 10 s is the same
   event. Returns 1, or 0 where there is none. Ask until then after each sample, or now and then. */
int strapdown_next_event(strapdown_filter *filter, strapdown_event *event);

/* Save a filter with what is needed to check it. */
void strapdown_save(strapdown_saved *saved, const strapdown_filter *filter);

/* Go on with a filter as it was saved: the next sample may be up to a day later, and the time
   between is a gap of the IMU like any other. STRAPDOWN_NOT_SAVED where it is damaged or of another
   export; then the filter is left as it is. */
int strapdown_restore(strapdown_filter *filter, const strapdown_saved *saved);

/* Of strapdown.o, for the functions above. */
void strapdown_run(strapdown_filter *filter);
void strapdown_attitude(const double rph[3], double C[9]);

#ifdef __cplusplus
}
#endif
#endif
