#include "clock.h"

#include "hal_step_timer.h"

namespace planarm {
namespace clock {

namespace {
uint32_t latest_ticks;
uint32_t begun_ticks;  // when the pass began
}  // namespace

void reset(uint32_t ticks) { latest_ticks = begun_ticks = ticks; }

uint32_t extend(uint16_t counter) {
    latest_ticks += static_cast<uint16_t>(counter - static_cast<uint16_t>(latest_ticks));
    return latest_ticks;
}

// A lap that is due or counted while this looks begins it again. In this order: once it is counted it is due
// no more.
uint32_t now() {
    uint8_t laps;
    uint16_t counter;
    do {
        laps = hal::laps();
        const hal::InterruptLock lock;
        counter = hal::counter();
    } while (hal::lap_is_due() || laps != hal::laps());
    const uint32_t ticks = (static_cast<uint32_t>(laps) << 16) | counter;
    latest_ticks += (ticks - latest_ticks) & 0xFFFFFF;
    return latest_ticks;
}

void begin_pass() { begun_ticks = now(); }

void begin_pass_at(uint32_t ticks) { begun_ticks = ticks; }

uint32_t pass_ticks() { return begun_ticks; }

int32_t ticks_until(uint32_t ticks) { return static_cast<int32_t>(ticks - begun_ticks); }

}  // namespace clock
}  // namespace planarm
