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

constexpr uint32_t TICKS_A_MS = wire::TICKS_HZ / 1000;
// The mark in EEPROM takes four bytes of 3.4 ms each.
constexpr uint32_t MARK_TICKS = 20 * TICKS_A_MS;

struct Power {
    bool energised;
    bool waking;
    uint32_t awake_ticks;
    uint32_t idle_for_ms;
    uint32_t counted_ticks;
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
    const uint32_t wake_ticks = settings::config.wake_ticks;
    at.awake_ticks = clock::pass_ticks() + (wake_ticks > MARK_TICKS ? wake_ticks : MARK_TICKS);
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
    at.idle_for_ms = 0;
    at.counted_ticks = clock::pass_ticks();
}

bool is_idle_too_long() {
    Power& at = hal::by_base(power);
    if (clock::pass_ticks() - at.counted_ticks >= TICKS_A_MS) {
        increase(at.counted_ticks, TICKS_A_MS);
        ++at.idle_for_ms;
    }
    const uint32_t idle_ms = settings::config.idle_ms;
    return idle_ms != 0 && at.energised && at.idle_for_ms >= idle_ms;
}

}  // namespace power
}  // namespace planarm
