/* Runs a flash image on simavr, as `./dev bench emulator` runs it on planarm_sim: with bytes 0, 1, 2, ... on the serial line
 * at a fixed rate. Usage: simavr_driver IMAGE.bin CYCLES BYTE_CYCLES BYTES
 * Prints the CPU seconds that the run took, the bytes that the firmware sent, and the edges of PB0. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "avr_ioport.h"
#include "avr_uart.h"
#include "sim_avr.h"

static unsigned long sent, edges;
static double byte_cycles;
static unsigned long fed, bytes;
static avr_irq_t *input;

static void silent(avr_t *avr, const int level, const char *format, va_list list) {
    (void)avr, (void)level, (void)format, (void)list;
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)value, (void)parameter;
    sent++;
}

static void on_edge(struct avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)value, (void)parameter;
    edges++;
}

static avr_cycle_count_t feed(avr_t *avr, avr_cycle_count_t when, void *parameter) {
    (void)avr, (void)when, (void)parameter;
    avr_raise_irq(input, fed++ & 0xFF);
    return fed < bytes ? (avr_cycle_count_t)((fed + 1) * byte_cycles) : 0;
}

int main(int count, char **words) {
    if (count != 5) return 2;
    avr_global_logger_set(silent);
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    if (avr == NULL || avr_init(avr) != 0) return 3;
    avr->frequency = 16000000;
    FILE *file = fopen(words[1], "rb");
    if (file == NULL) return 4;
    avr->codeend = fread(avr->flash, 1, avr->flashend + 1, file);
    fclose(file);
    const uint64_t cycles = strtoull(words[2], NULL, 10);
    byte_cycles = strtod(words[3], NULL);
    bytes = strtoul(words[4], NULL, 10);
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 0), on_edge, NULL);
    if (bytes) avr_cycle_timer_register(avr, (avr_cycle_count_t)byte_cycles, feed, NULL);
    const clock_t began = clock();
    while (avr->cycle < cycles) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 5;
    }
    printf("%.6f %lu %lu\n", (double)(clock() - began) / CLOCKS_PER_SEC, sent, edges);
    return 0;
}
