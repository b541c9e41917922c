#include "settings.h"

namespace planarm {
namespace settings {

wire::Config config;
wire::SoftLimits soft_limits;

void reset() {
    config = wire::Config();
    config.wake_ticks = wire::DEFAULT_WAKE_TICKS;
    soft_limits = wire::SoftLimits();
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        config.start_stop_ticks[joint] = wire::DEFAULT_START_STOP_TICKS;
        soft_limits.most_usteps[joint] = -1;
    }
}

bool has_option(Option option) { return (config.options & option) != 0; }

}  // namespace settings
}  // namespace planarm
