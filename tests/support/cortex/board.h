/* board.h: the board that the loop of docs/how-to/firmware.md runs on. */
#include <stdint.h>

typedef struct {
    double clock, dt, dtheta[3], dv[3];
} imu_sample;

void board_start(void);
int board_pulse(double *clock);
int board_byte(uint8_t *byte);
int board_sample(imu_sample *sample);
int board_power_fails(void);
