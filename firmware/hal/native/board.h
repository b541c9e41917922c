// A simulated board around the firmware's core, for tests on a PC: Timer1 with two compare outputs, pins, and
// a serial line. It is not an emulator: instructions take no time. Time passes where the core reads the
// timer, between its passes, and before and after each step interrupt, by the delays that a test sets.
#pragma once

#include <stddef.h>
#include <stdint.h>

extern "C" {

// A change of an output pin; `pin` is the number on the board.
struct planarm_edge {
    uint64_t tick;
    uint8_t pin;
    uint8_t level;
};

// How long things take, in ticks.
struct planarm_delays {
    uint32_t pass;        // a pass of the main program, besides its interrupts
    uint32_t entry;       // from a match to the first statement of its interrupt
    uint32_t late_entry;  // the same for one interrupt in `late_every`
    uint32_t late_every;  // 0: none is late
    uint32_t leave;       // from the last statement of an interrupt until the next one may come
};

// Starts the board and the firmware anew, with the timer at `tick`.
void planarm_power_on(uint32_t boot_count, uint64_t tick, planarm_delays delays);

// Brings bytes to the receive ring at once; what does not fit is lost and counted.
void planarm_receive(const uint8_t* bytes, size_t count);

// Sets the inputs, as hal::inputs tells them.
void planarm_set_inputs(uint8_t inputs);

// The supervisor alone: whether its table has a row for the event, which is then carried out; its state; a
// fault.
uint8_t planarm_signal(uint8_t event);
uint8_t planarm_state();
void planarm_latch(uint8_t fault);

// Runs the firmware until `ticks` more have passed.
void planarm_run(uint64_t ticks);

uint64_t planarm_now();

// Move at most `most` sent bytes or pin changes, oldest first, to the caller; return how many.
size_t planarm_take_sent(uint8_t* bytes, size_t most);
size_t planarm_take_edges(planarm_edge* edges, size_t most);
}
