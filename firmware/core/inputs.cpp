#include "inputs.h"

#include "clock.h"
#include "hal_base.h"
#include "hal_pins.h"
#include "settings.h"

namespace planarm {
namespace inputs {

namespace {

struct Inputs {
    uint8_t raw;       // bit j: joint j, hit
    uint8_t steady;    // debounced
    uint8_t left;      // hit before the motion began, and not yet open since
    uint16_t changed;  // when `raw` did, in 256 ticks
};

Inputs state;

// In 256 ticks, modulo a second; one more for what that cuts off.
constexpr uint16_t STEADY = wire::DEBOUNCE_TICKS / 256 + 2;

uint16_t now_256() { return static_cast<uint16_t>(clock::pass_ticks() >> 8); }

constexpr uint8_t JOINTS_MASK = (1 << wire::JOINTS) - 1;

uint8_t read() {
    uint8_t bits = hal::inputs();
    if (settings::has_option(settings::LIMITS_OPEN_WHEN_HIT)) bits = static_cast<uint8_t>(~bits);
    return bits & JOINTS_MASK;
}

bool is_set(uint8_t bits, uint8_t joint) { return ((bits >> joint) & 1) != 0; }

}  // namespace

void reset() {
    Inputs& at = hal::by_base(state);
    at.raw = at.steady = at.left = read();
    at.changed = now_256();
}

void serve() {
    Inputs& at = hal::by_base(state);
    const uint8_t now = read();
    if (now != at.raw) {
        at.raw = now;
        at.changed = now_256();
    } else if (at.steady != now && static_cast<uint16_t>(now_256() - at.changed) >= STEADY) {
        at.steady = now;
        at.left &= now;
    }
}

void excuse_hit() { state.left = state.steady; }

bool is_hit(uint8_t joint) { return is_set(state.steady, joint); }

uint8_t hit_joint() {
    if (!settings::has_option(settings::LIMIT_SWITCHES)) return wire::JOINTS;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (is_set(static_cast<uint8_t>(state.steady & ~state.left), joint)) return joint;
    }
    return wire::JOINTS;
}

uint8_t report() { return static_cast<uint8_t>(state.steady | (hal::inputs() & hal::STOP_INPUT_OPEN)); }

}  // namespace inputs
}  // namespace planarm
