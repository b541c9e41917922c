/* Steps simavr's instruction core and records its state after every instruction, for the comparison in
 * test_chip_simavr.py. Only the core is used: no timers, no interrupts, no I/O beyond plain registers. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sim_avr.h"
#include "sim_core.h"

enum { REGISTERS = 32, SRAM = 0x100, SRAM_BYTES = 2048, WORDS = 16384, ROW = 36 };

static avr_t *avr;

static void silent(avr_t *a, const int level, const char *format, va_list list) {
    (void)a, (void)level, (void)format, (void)list;
}

int shim_open(void) {
    avr_global_logger_set(silent);
    avr = avr_make_mcu_by_name("atmega328p");
    if (avr == NULL || avr_init(avr) != 0) return -1;
    avr->frequency = 16000000;
    return 0;
}

/* Runs up to `steps` instructions from the given state. `starts` tells at which words instructions of the program
 * begin; the run ends at any other word, and before a return to an address beyond the flash. Each row of `trace` is
 * pc (words), cycles, SREG, SP, then the registers. Returns the number of instructions run. */
int shim_run(const uint8_t *flash, const uint8_t *starts, const uint8_t *registers, uint8_t *sram, int pc, int sreg,
             int sp, int steps, int32_t *trace) {
    memcpy(avr->flash, flash, 2 * WORDS);
    memcpy(avr->data, registers, REGISTERS);
    memset(avr->data + REGISTERS, 0, SRAM - REGISTERS);
    memcpy(avr->data + SRAM, sram, SRAM_BYTES);
    for (int bit = 0; bit < 8; bit++) avr->sreg[bit] = sreg >> bit & 1;
    avr->data[0x5D] = sp & 0xFF;
    avr->data[0x5E] = sp >> 8;
    avr->pc = 2 * pc;
    avr->cycle = 0;
    avr->state = cpu_Running;
    int done = 0;
    while (done < steps && avr->pc < 2 * WORDS && starts[avr->pc / 2]) {
        const int word = avr->flash[avr->pc] | avr->flash[avr->pc + 1] << 8;
        const int top = avr->data[0x5D] | avr->data[0x5E] << 8;
        if ((word == 0x9508 || word == 0x9518) && avr->data[top + 1] >= WORDS / 256) break;
        avr->pc = avr_run_one(avr);
        int32_t *row = trace + ROW * done++;
        int status = 0;
        for (int bit = 0; bit < 8; bit++) status |= avr->sreg[bit] << bit;
        row[0] = avr->pc / 2;
        row[1] = (int32_t)avr->cycle;
        row[2] = status;
        row[3] = avr->data[0x5D] | avr->data[0x5E] << 8;
        for (int n = 0; n < REGISTERS; n++) row[4 + n] = avr->data[n];
    }
    memcpy(sram, avr->data + SRAM, SRAM_BYTES);
    return done;
}
