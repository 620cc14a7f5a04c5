/* main.c: replays replay.bin through the filter and compares it with what Python made of it.

       main [FILE [LARGEST]]

   FILE: replay.bin where none is named; LARGEST: difference in standard deviations from which on the
   result is 1, 1e-9 where none is given. Here a file stands in the place of the drivers of an IMU and of
   a receiver; firmware calls the same four functions. */
#include "strapdown.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { END, SAMPLE, FIX, ROW };
enum { VALUES = sizeof(strapdown_values) / sizeof(double) };

static strapdown_filter filter; /* all the memory that there is */

static int read_numbers(FILE *file, void *numbers, size_t count)
{
    return fread(numbers, 8, count, file) == count;
}

/* The largest difference of two rows, in standard deviations of the second. */
static double difference(const double *got, const double *want)
{
    const double earth = 6.4e6;
    double worst = 0;
    for (int i = 0; i < 15; i++) {
        double d, std = want[STRAPDOWN_ROW_STD + i];
        if (i < 3)
            d = (got[STRAPDOWN_ROW_LLA + i] - want[STRAPDOWN_ROW_LLA + i]) * (i < 2 ? earth : 1);
        else if (i < 6)
            d = got[STRAPDOWN_ROW_V + i - 3] - want[STRAPDOWN_ROW_V + i - 3];
        else if (i < 9)
            d = 2 * (got[STRAPDOWN_ROW_Q + i - 5] - want[STRAPDOWN_ROW_Q + i - 5]);
        else
            d = got[STRAPDOWN_ROW_BIASES + i - 9] - want[STRAPDOWN_ROW_BIASES + i - 9];
        if (!(std > 0)) /* not estimated */
            continue;
        d = fmax(fabs(d), fabs(got[STRAPDOWN_ROW_STD + i] - std)) / std;
        if (!(d <= worst))
            worst = d;
    }
    return worst;
}

static int failed(const char *what)
{
    printf("%s\n", what);
    return 2;
}

int main(int argc, char **argv)
{
    FILE *file = fopen(argc > 1 ? argv[1] : "replay.bin", "rb");
    double largest = argc > 2 ? strtod(argv[2], NULL) : 1e-9;
    if (!file)
        return failed("there is no replay.bin");

    int64_t head[5];
    strapdown_values values;
    if (!read_numbers(file, head, 5) || head[1] != VALUES || head[2] != STRAPDOWN_SOURCES
        || head[3] != STRAPDOWN_PARAMETERS || head[4] != STRAPDOWN_COLUMNS
        || !read_numbers(file, &values, VALUES))
        return failed("replay.bin is of another export");
    if (strapdown_start(&filter, &values) < 0)
        return failed("the filter refuses its start");
    for (int source = 0; source < STRAPDOWN_SOURCES; source++) {
        double parameters[STRAPDOWN_PARAMETERS], gate;
        if (!read_numbers(file, parameters, STRAPDOWN_PARAMETERS) || !read_numbers(file, &gate, 1)
            || strapdown_source(&filter, source, parameters, gate) < 0)
            return failed("the filter refuses a source");
    }

    long samples = 0, rows = 0, same = 0, not_taken = 0;
    double worst = 0, numbers[8], row[STRAPDOWN_COLUMNS];
    int64_t kind = END, source;
    strapdown_event event;
    while (read_numbers(file, &kind, 1) && kind != END) {
        if (kind == FIX) {
            if (!read_numbers(file, &source, 1) || !read_numbers(file, numbers, 7))
                break;
            if (strapdown_fix(&filter, (int)source, numbers[0], numbers + 1, numbers + 4) < 0)
                not_taken++;
        } else if (kind == SAMPLE) {
            if (!read_numbers(file, numbers, 8))
                break;
            samples++;
            if (strapdown_sample(&filter, numbers[0], numbers[1], numbers + 2, numbers + 5) < 0)
                return failed("the filter stopped, or refuses a sample");
            while (strapdown_next_event(&filter, &event))
                printf("%.2f s: event %d of %d, %g\n", event.t, event.code, event.which, event.value);
        } else {
            if (!read_numbers(file, row, STRAPDOWN_COLUMNS))
                break;
            double d = difference(filter.out.nav[0], row);
            if (!(d <= worst))
                worst = d;
            same += !memcmp(filter.out.nav[0], row, sizeof row);
            rows++;
        }
    }
    fclose(file);
    if (kind != END)
        return failed("replay.bin ends too early");
    for (int i = 0; i < STRAPDOWN_SOURCES; i++)
        printf("source %d: %ld accepted, %ld rejected\n", i, (long)filter.cursor.books[i].accepted,
               (long)filter.cursor.books[i].rejected);
    printf("%ld samples, %ld fixes not taken, %lu bytes of state\n", samples, not_taken,
           (unsigned long)sizeof filter);
    printf("%ld of %ld rows the same to the bit; largest difference %.3g standard deviations\n", same,
           rows, worst);
    return !(rows > 0 && worst <= largest);
}
