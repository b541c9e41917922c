#include "power.h"

#include "clock.h"
#include "fixed.h"
#include "hal_base.h"
#include "hal_journal.h"
#include "hal_pins.h"
#include "settings.h"

namespace planarm {
namespace power {

namespace {

constexpr uint16_t TICKS_A_MS = wire::TICKS_HZ / 1000;
// The mark in EEPROM takes four bytes of 3.4 ms each.
constexpr uint32_t MARK_TICKS = 20 * static_cast<uint32_t>(TICKS_A_MS);

struct Power {
    bool energised;
    bool waking;
    uint32_t awake_ticks;
    uint32_t idle_left_ms;   // until the drivers are released; 0: never
    uint16_t counted_ticks;  // where the last of its milliseconds began, modulo 2^16
};

Power power;

}  // namespace

void reset() { hal::clear_at_start(power); }

void configure() { hal::set_enable_active_high(settings::has_option(settings::ENABLE_ACTIVE_HIGH)); }

void energise() {
    hal::journal_mark(true);
    hal::drivers_enable(true);
    Power& at = hal::by_base(power);
    at.energised = at.waking = true;
    at.awake_ticks = clock::pass_ticks();
    increase(at.awake_ticks, most_of(settings::config.wake_ticks, MARK_TICKS));
}

void release() {
    hal::drivers_enable(false);
    if (power.energised) hal::journal_mark(false);
    power.energised = power.waking = false;
}

void serve() {
    if (clock::has_come(power.awake_ticks)) power.waking = false;
}

uint32_t ready_ticks() {
    serve();
    const Power& at = hal::by_base(power);
    return at.waking ? at.awake_ticks : clock::pass_ticks();
}

void note_activity() {
    Power& at = hal::by_base(power);
    at.idle_left_ms = settings::config.idle_ms;
    at.counted_ticks = static_cast<uint16_t>(clock::pass_ticks());
}

// A pass of more than 4.1 ms, as when the EEPROM is waited for, counts for less.
bool is_idle_too_long() {
    Power& at = hal::by_base(power);
    if (static_cast<uint16_t>(static_cast<uint16_t>(clock::pass_ticks()) - at.counted_ticks) < TICKS_A_MS)
        return false;
    at.counted_ticks = static_cast<uint16_t>(at.counted_ticks + TICKS_A_MS);
    if (at.idle_left_ms == 0) return false;
    return --at.idle_left_ms == 0;
}

}  // namespace power
}  // namespace planarm
