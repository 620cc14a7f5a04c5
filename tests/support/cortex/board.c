/* board.c: an emulated board (mps2-an386, mps2-an500 of qemu-system-arm) as firmware meets one. Its UART
   brings the records of desk.c; an interrupt puts them into a queue. The UART sends the sentences.
   More records: 'V' the power fails, 'R' reset, 'E' end. Two places of memory that a reset leaves stand
   for flash. At the end it tells what calls took, by a timer that counts instructions (-icount). */
#include "board.h"

#include "loop.h"

#include <string.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
enum { TIMER = 0x40000000, UART = 0x40004000 };
#define UART_DATA REGISTER(UART)
#define UART_STATE REGISTER(UART + 4)
#define UART_CONTROL REGISTER(UART + 8)
#define UART_INTERRUPT REGISTER(UART + 12)
#define UART_DIVIDER REGISTER(UART + 16)
enum { SENDS = 1, RECEIVES = 2, INTERRUPTS = 8, FULL_OUT = 1, FULL_IN = 2 };

/* ---- start ---- */

extern uint32_t __stack_top[], __stack_watched[], __data[], __data_end[], __data_from[], __bss[], __bss_end[];
static const uint32_t PAINT = 0xa5a5a5a5;
enum { STACK = 16384 }; /* words of it that are watched, as board.ld has them */

int main(void);

__attribute__((noreturn)) static void leave(uint32_t reason)
{
    for (;;)
        __asm volatile("mov r0, #0x18\n mov r1, %0\n bkpt 0xab" : : "r"(reason) : "r0", "r1");
}

__attribute__((noreturn, used)) void begin(void)
{
    memcpy(__data, __data_from, (size_t)((char *)__data_end - (char *)__data));
    memset(__bss, 0, (size_t)((char *)__bss_end - (char *)__bss));
    uint32_t *top = (uint32_t *)__builtin_frame_address(0) - 64;
    for (uint32_t *word = __stack_watched; word < top; word++)
        *word = PAINT;
    main();
    leave(0x20023);
}

/* The floating-point unit on, then the rest. */
__attribute__((naked)) void reset(void)
{
    __asm volatile("ldr r0, =0xE000ED88\n ldr r1, [r0]\n orr r1, r1, #0xF00000\n str r1, [r0]\n"
                   "dsb\n isb\n b begin\n");
}

static void fault(void)
{
    leave(0x20023);
}

/* ---- the queue ---- */

enum { QUEUE = 4096 };
static volatile uint8_t queue[QUEUE];
static volatile uint32_t came, taken;

static void receive(void)
{
    UART_INTERRUPT = 2;
    if (came - taken < QUEUE)
        queue[came++ % QUEUE] = (uint8_t)UART_DATA;
    else
        UART_CONTROL = SENDS | RECEIVES; /* its line waits until there is room */
}

__attribute__((section(".vectors"), used)) void *const vectors[17] = {
    __stack_top, reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, 0, 0, 0, 0, 0, receive};

enum { NOTHING = -1, SAMPLE, AFTER_BYTES, BYTE, KINDS };
static uint32_t longest[KINDS], began;
static int handed = NOTHING; /* what the loop was given before; a sample after bytes may follow a fix */
static int bytes_came;

static void measure(void)
{
    if (handed == NOTHING)
        return;
    uint32_t took = began - REGISTER(TIMER + 4);
    if (took > longest[handed])
        longest[handed] = took;
    handed = NOTHING;
}

static int next(uint8_t kind, void *into, uint32_t size)
{
    measure();
    if (came - taken < 1 + size || queue[taken % QUEUE] != kind)
        return 0;
    for (uint32_t i = 0; i < size; i++)
        ((uint8_t *)into)[i] = queue[(taken + 1 + i) % QUEUE];
    taken += 1 + size;
    if (!(UART_CONTROL & INTERRUPTS)) {
        UART_CONTROL = SENDS | RECEIVES | INTERRUPTS;
        if (UART_STATE & FULL_IN)
            queue[came++ % QUEUE] = (uint8_t)UART_DATA;
    }
    return 1;
}

static int timed(int found, int kind)
{
    if (found) {
        handed = kind;
        began = REGISTER(TIMER + 4);
    }
    return found;
}

/* ---- what the loop asks ---- */

void board_start(void)
{
    REGISTER(TIMER + 8) = REGISTER(TIMER + 4) = 0xffffffff;
    REGISTER(TIMER) = 1;
    UART_DIVIDER = 16;
    UART_CONTROL = SENDS | RECEIVES | INTERRUPTS;
    REGISTER(0xE000E100) = 1; /* its interrupt */
}

int board_pulse(double *clock)
{
    return next('P', clock, sizeof *clock);
}

int board_byte(uint8_t *byte)
{
    int found = timed(next('B', byte, 1), BYTE);
    bytes_came |= found;
    return found;
}

int board_sample(imu_sample *sample)
{
    int found = timed(next('S', sample, sizeof *sample), bytes_came ? AFTER_BYTES : SAMPLE);
    bytes_came &= !found;
    return found;
}

static void say(const char *name, uint64_t number)
{
    char text[64], digits[24];
    int length = 0, count = 0;
    while (*name)
        text[length++] = *name++;
    do
        digits[count++] = (char)('0' + number % 10);
    while (number /= 10);
    while (count)
        text[length++] = digits[--count];
    text[length++] = '\n';
    text[length] = 0;
    __asm volatile("mov r0, #4\n mov r1, %0\n bkpt 0xab" : : "r"(text) : "r0", "r1", "memory");
}

static uint32_t used_stack(void)
{
    uint32_t free = 0;
    while (free < STACK && __stack_watched[free] == PAINT)
        free++;
    return 4 * (STACK - free);
}

int board_power_fails(void)
{
    if (next('R', 0, 0)) {
        __asm volatile("dsb");
        REGISTER(0xE000ED0C) = 0x05fa0004;
        for (;;)
            ;
    }
    if (next('E', 0, 0)) {
        say("sample ", longest[SAMPLE]);
        say("sample after a fix ", longest[AFTER_BYTES]);
        say("byte ", longest[BYTE]);
        say("stack ", used_stack());
        leave(0x20026);
    }
    next('\n', 0, 0); /* stands where a reset loses what the queue holds */
    return next('V', 0, 0);
}

void board_write(char byte)
{
    while (UART_STATE & FULL_OUT)
        ;
    UART_DATA = (uint32_t)byte;
}

__attribute__((section(".saved"))) static strapdown_saved places[2];

const strapdown_saved *board_saved(int place)
{
    return &places[place];
}

void board_save(int place, const strapdown_saved *saved)
{
    places[place] = *saved;
}
