/* strapdown_delayed.h: the filter of strapdown.h with fixes that come late.

   The newest state follows every sample at once. A fix may hold up to STRAPDOWN_KEPT samples before
   it: the filter then goes back and takes these samples again, so that the state is what it would be
   had the fix come in time, to the bit. A late fix costs as many steps as samples since it holds. */
#ifndef STRAPDOWN_DELAYED_H
#define STRAPDOWN_DELAYED_H

#include "strapdown.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Samples that are kept; another number is given to the compiler, -DSTRAPDOWN_KEPT=100. */
#ifndef STRAPDOWN_KEPT
#define STRAPDOWN_KEPT 200
#endif

/* A sample of the IMU, as strapdown_sample takes it. */
typedef struct {
    double t, dt, dtheta[3], dv[3];
} strapdown_kept_sample;

/* A filter with the samples that it may go back over. */
typedef struct {
    /* before the samples that are kept; its waiting fixes are those used since, too */
    strapdown_filter settled;
    /* after them: read this one */
    strapdown_filter newest;
    /* ring of samples, the oldest at `first` */
    strapdown_kept_sample samples[STRAPDOWN_KEPT];
    int first, count;
} strapdown_delayed;

/* Begin with a filter that was started and whose sources are set, or that was restored. */
void strapdown_delay(strapdown_delayed *delayed, const strapdown_filter *filter);

/* As strapdown_sample. */
int strapdown_delayed_sample(
    strapdown_delayed *delayed, double t, double dt, const double dtheta[3], const double dv[3]);

/* As strapdown_fix, also for a fix that holds before the newest sample. STRAPDOWN_LATE: it holds
   before the oldest sample that is kept. Of the fixes since that sample there is room for
   STRAPDOWN_WAITING; where there are more, the oldest samples and fixes are no longer kept. */
int strapdown_delayed_fix(
    strapdown_delayed *delayed, int source, double t, const double *y, const double *std);

#ifdef __cplusplus
}
#endif
#endif
