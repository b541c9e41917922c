#include "clock.h"

#include "hal_step_timer.h"

namespace planarm {
namespace clock {

namespace {
uint32_t latest_ticks;
}

void reset(uint32_t ticks) { latest_ticks = ticks; }

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

}  // namespace clock
}  // namespace planarm
