/* desk.c: the board of loop.h on a desk. It reads a recorded stream from standard input, in the order
   of arrival: 'S' and eight doubles (clock, dt, dtheta, dv) for a sample, 'P' and a double (clock) for
   a pulse, 'B' and a byte of the receiver. Sentences go to standard output.

   ./desk [STATE] < stream: begins with the state in that file, if it is there, and saves it at the
   end. */
#include "loop.h"

#include <stdio.h>

static strapdown_saved kept;
static int is_kept;

void board_write(char byte)
{
    putchar(byte);
}

const strapdown_saved *board_saved(int place)
{
    return place == 0 && is_kept ? &kept : 0;
}

void board_save(int place, const strapdown_saved *saved)
{
    (void)place;
    kept = *saved;
    is_kept = 1;
}

static int take(int kind)
{
    double n[8];
    if (kind == 'S' && fread(n, sizeof n, 1, stdin) == 1)
        loop_sample(n[0], n[1], n + 2, n + 5);
    else if (kind == 'P' && fread(n, sizeof *n, 1, stdin) == 1)
        loop_pulse(n[0]);
    else if (kind == 'B')
        loop_byte((uint8_t)getchar());
    else
        return 0;
    return 1;
}

int main(int count, char **words)
{
    FILE *file = count > 1 ? fopen(words[1], "rb") : NULL;
    int kind;
    if (file) {
        is_kept = fread(&kept, sizeof kept, 1, file) == 1;
        fclose(file);
    }
    loop_start();
    while ((kind = getchar()) != EOF) {
        if (!take(kind))
            return 1;
    }
    if (count < 2)
        return 0;
    loop_save();
    file = fopen(words[1], "wb");
    return !file || fwrite(&kept, sizeof kept, 1, file) != 1 || fclose(file);
}
