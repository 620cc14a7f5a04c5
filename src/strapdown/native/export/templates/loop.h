/* loop.h: a navigation system on a microcontroller, and what it needs of your board.

   loop.c reads UBX-NAV-PVT of a receiver and samples of an IMU, and writes GGA and RMC. Times are
   seconds of your board's clock: a timer that counts on without beginning again, as of 64 bits. The
   receiver's pulse per second ties it to GPS time. */
#ifndef LOOP_H
#define LOOP_H

#include "strapdown.h"

/* ---- your board calls these, all from one task or loop and none from an interrupt ---- */

/* Once, before the others: go on with the newer of the saved states, if there is one. */
void loop_start(void);

/* The edge of the receiver's pulse per second, at a time of your clock. */
void loop_pulse(double clock);

/* A byte that came from the receiver. */
void loop_byte(uint8_t byte);

/* A sample of the IMU that ends at a time of your clock and lasts dt, s: the integrals of angular
   rate, rad, and specific force, m/s, over it, forward, right, down. */
void loop_sample(double clock, double dt, const double dtheta[3], const double dv[3]);

/* Save the state, as when the power is going or the vehicle stands. */
void loop_save(void);

/* ---- your board has these ---- */

/* Queue a byte of a sentence for the port that it leaves by. It must not wait. */
void board_write(char byte);

/* One of two places (0, 1) in memory that outlives a restart, of sizeof(strapdown_saved) bytes at an
   address that 8 divides, such as a sector of flash each; null: the board has none. */
const strapdown_saved *board_saved(int place);

/* Write it to that place. */
void board_save(int place, const strapdown_saved *saved);

#endif
