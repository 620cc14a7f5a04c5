/* Enough of a start for a Cortex-M under qemu-system-arm: vectors, the floating-point unit on, then
   newlib's own start, whose files and exit code are the host's (semihosting). */
#include <stdint.h>

extern void _start(void);
extern uint32_t __stack_top[];

__attribute__((naked)) void reset(void)
{
    __asm volatile("ldr r0, =0xE000ED88\n ldr r1, [r0]\n orr r1, r1, #0xF00000\n str r1, [r0]\n"
                   "dsb\n isb\n bl _start\n");
}

static void stop(void)
{
    for (;;)
        __asm volatile("mov r0, #0x18\n ldr r1, =0x20023\n bkpt 0xab");
}

__attribute__((section(".vectors"), used)) void *const vectors[16] = {
    __stack_top, reset, stop, stop, stop, stop, stop};

void _init(void) {}
void _fini(void) {}
