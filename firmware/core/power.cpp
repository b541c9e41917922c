#include "power.h"

#include "clock.h"
#include "hal_journal.h"
#include "hal_pins.h"

namespace planarm {
namespace power {

namespace {

constexpr uint32_t TICKS_A_MS = wire::TICKS_HZ / 1000;
// The mark in EEPROM takes four bytes of 3.4 ms each.
constexpr uint32_t MARK_TICKS = 20 * TICKS_A_MS;

Config config;
bool energised;
uint32_t awake_ticks;
bool waking;
uint32_t idle_for_ms;
uint32_t counted_ticks;

}  // namespace

void reset() {
    counted_ticks = clock::pass_ticks();
    config = {0, 0, wire::DEFAULT_WAKE_TICKS};
    energised = waking = false;
    idle_for_ms = 0;
}

void configure(const Config& told) {
    config = told;
    hal::set_enable_active_high(has_option(ENABLE_ACTIVE_HIGH));
    hal::drivers_enable(false);
}

bool has_option(Option option) { return (config.options & option) != 0; }

void energise() {
    hal::journal_mark(true);
    hal::drivers_enable(true);
    energised = waking = true;
    awake_ticks = clock::pass_ticks() + (config.wake_ticks > MARK_TICKS ? config.wake_ticks : MARK_TICKS);
}

void release() {
    hal::drivers_enable(false);
    if (energised) hal::journal_mark(false);
    energised = waking = false;
}

uint32_t ready_ticks() {
    waking = waking && !clock::has_come(awake_ticks);
    return waking ? awake_ticks : clock::pass_ticks();
}

void note_activity() {
    idle_for_ms = 0;
    counted_ticks = clock::pass_ticks();
}

bool is_idle_too_long() {
    ready_ticks();  // notices that they woke before the clock has gone round
    if (clock::pass_ticks() - counted_ticks >= TICKS_A_MS) {
        counted_ticks += TICKS_A_MS;
        ++idle_for_ms;
    }
    return config.idle_ms != 0 && energised && idle_for_ms >= config.idle_ms;
}

}  // namespace power
}  // namespace planarm
