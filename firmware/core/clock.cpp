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

uint32_t now() {
    uint16_t counter;
    {
        const hal::InterruptLock lock;
        counter = hal::counter();
    }
    return extend(counter);
}

void begin_pass() { begun_ticks = now(); }

uint32_t pass_ticks() { return begun_ticks; }

int32_t ticks_until(uint32_t ticks) { return static_cast<int32_t>(ticks - begun_ticks); }

}  // namespace clock
}  // namespace planarm
