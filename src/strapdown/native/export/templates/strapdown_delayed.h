/* strapdown_delayed.h: the filter of strapdown.h with fixes that come late.

   The newest state follows every sample at once. A fix may hold up to STRAPDOWN_KEPT samples before
   it: with the next sample the filter takes all samples that are kept again, so that the state is what
   it would be had the fix come in time, to the bit. However many fixes were late, and however late,
   that sample costs STRAPDOWN_KEPT + 2 steps; any other costs two. */
#ifndef STRAPDOWN_DELAYED_H
#define STRAPDOWN_DELAYED_H

#include "strapdown.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Samples that are kept: as many as a fix is late at most, and no more than there is time for. Another
   number is given to the compiler for every file, -DSTRAPDOWN_KEPT=100. */
#ifndef STRAPDOWN_KEPT
#define STRAPDOWN_KEPT 50
#endif

/* A sample of the IMU, as strapdown_sample takes it. */
typedef struct {
    double t, dt, dtheta[3], dv[3];
} strapdown_kept_sample;

/* A filter with the samples that it may go back over. */
typedef struct {
    /* before the samples that are kept; its waiting fixes are those used since, too. Ask this one
       for events: late fixes no longer change what it tells */
    strapdown_filter settled;
    /* after them: read the state of this one */
    strapdown_filter newest;
    /* 1: a late fix is not in `newest` yet */
    int behind;
    /* ring of samples, the oldest at `first` */
    strapdown_kept_sample samples[STRAPDOWN_KEPT];
    int first, count;
} strapdown_delayed;

/* Begin with a filter that was started and whose sources are set, or that was restored. */
void strapdown_delay(strapdown_delayed *delayed, const strapdown_filter *filter);

/* As strapdown_sample; late fixes since the last one are in the state from here on. */
int strapdown_delayed_sample(
    strapdown_delayed *delayed, double t, double dt, const double dtheta[3], const double dv[3]);

/* As strapdown_fix, also for a fix that holds before the newest sample. STRAPDOWN_LATE: it holds
   before the oldest sample that is kept. Of the fixes since that sample there is room for
   STRAPDOWN_WAITING; where there are more, the oldest samples and fixes are no longer kept. */
int strapdown_delayed_fix(
    strapdown_delayed *delayed, int source, double t, const double *y, const double *std);

/* Take late fixes into `newest` now, before the next sample: to save it after a fix. */
void strapdown_delayed_catch_up(strapdown_delayed *delayed);

#ifdef __cplusplus
}
#endif
#endif
