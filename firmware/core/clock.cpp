#include "clock.h"

#include "fixed.h"
#include "hal_base.h"
#include "hal_step_timer.h"

namespace planarm {
namespace clock {

namespace {

struct Clock {
    uint32_t latest_ticks;  // of the device's
    uint32_t stood_ticks;   // by which the motion's is behind
    // When the pass began, by both.
    uint32_t begun_device_ticks;
    uint32_t begun_ticks;
};

Clock state;

Clock& current() { return hal::by_base(state); }

// A lap is 2^16 ticks: the low half stays.
void add_laps(uint32_t& ticks, uint16_t laps) {
    uint16_t halves[2];
    __builtin_memcpy(halves, &ticks, sizeof(halves));
    halves[1] = static_cast<uint16_t>(halves[1] + laps);
    __builtin_memcpy(&ticks, halves, sizeof(halves));
}

}  // namespace

void reset(uint32_t ticks) {
    Clock& at = current();
    at.latest_ticks = at.begun_device_ticks = at.begun_ticks = ticks;
    at.stood_ticks = 0;
}

uint32_t extend(uint16_t counter) {
    Clock& at = current();
    at.latest_ticks += static_cast<uint16_t>(counter - static_cast<uint16_t>(at.latest_ticks));
    return at.latest_ticks - at.stood_ticks;
}

// A lap that is due or counted while this looks begins it again. In this order: once it is counted it is due
// no more.
void begin_pass() {
    uint8_t laps;
    uint16_t counter;
    do {
        laps = hal::laps();
        const hal::InterruptLock lock;
        counter = hal::counter();
    } while (hal::lap_is_due() || laps != hal::laps());
    Clock& at = current();
    const uint32_t ticks = (static_cast<uint32_t>(laps) << 16) | counter;
    increase(at.latest_ticks, (ticks - at.latest_ticks) & 0xFFFFFF);
    at.begun_device_ticks = at.latest_ticks;
    at.begun_ticks = at.begun_device_ticks - at.stood_ticks;
}

void begin_pass_at(uint32_t ticks) { current().begun_ticks = ticks; }

uint32_t pass_ticks() { return current().begun_device_ticks; }

uint32_t device_ticks(uint32_t ticks) { return ticks + current().stood_ticks; }

int32_t ticks_until(uint32_t ticks) { return static_cast<int32_t>(ticks - current().begun_ticks); }

void stand_before(uint32_t ticks) {
    Clock& at = current();
    const uint16_t laps = static_cast<uint16_t>(((at.begun_ticks - ticks) >> 16) + 1);
    add_laps(at.stood_ticks, laps);
    add_laps(at.begun_ticks, static_cast<uint16_t>(0 - laps));
}

void end_standing() {
    Clock& at = current();
    at.stood_ticks = 0;
    at.begun_ticks = at.begun_device_ticks;
}

}  // namespace clock
}  // namespace planarm
