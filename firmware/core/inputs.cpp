#include "inputs.h"

#include "clock.h"
#include "hal_pins.h"
#include "settings.h"

namespace planarm {
namespace inputs {

namespace {

uint8_t raw;     // bit j: joint j, hit
uint8_t steady;  // debounced
uint8_t left;    // hit before the motion began, and not yet open since
uint32_t changed_ticks;

uint8_t read() {
    uint8_t bits = hal::inputs();
    if (settings::has_option(settings::LIMITS_OPEN_WHEN_HIT))
        bits ^= static_cast<uint8_t>(~hal::STOP_INPUT_OPEN);
    return bits;
}

constexpr uint8_t JOINTS_MASK = (1 << wire::JOINTS) - 1;

bool is_set(uint8_t bits, uint8_t joint) { return ((bits >> joint) & 1) != 0; }

}  // namespace

void reset() {
    raw = steady = left = static_cast<uint8_t>(read() & JOINTS_MASK);
    changed_ticks = clock::pass_ticks();
}

void serve() {
    const uint8_t now = static_cast<uint8_t>(read() & JOINTS_MASK);
    if (now != raw) {
        raw = now;
        changed_ticks = clock::pass_ticks();
    } else if (steady != raw && clock::pass_ticks() - changed_ticks >= wire::DEBOUNCE_TICKS) {
        steady = raw;
        left &= steady;
    }
}

void excuse_hit() { left = steady; }

bool is_hit(uint8_t joint) { return is_set(steady, joint); }

uint8_t hit_joint() {
    if (!settings::has_option(settings::LIMIT_SWITCHES)) return wire::JOINTS;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (is_set(static_cast<uint8_t>(steady & ~left), joint)) return joint;
    }
    return wire::JOINTS;
}

uint8_t report() { return static_cast<uint8_t>(steady | (hal::inputs() & hal::STOP_INPUT_OPEN)); }

}  // namespace inputs
}  // namespace planarm
