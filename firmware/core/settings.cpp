#include "settings.h"

#include "hal_base.h"

namespace planarm {
namespace settings {

wire::Config config;
wire::SoftLimits soft_limits;

void reset() {
    hal::clear_at_start(config);
    hal::clear_at_start(soft_limits);
    config.wake_ticks = wire::DEFAULT_WAKE_TICKS;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        config.start_stop_ticks[joint] = wire::DEFAULT_START_STOP_TICKS;
        soft_limits.most_usteps[joint] = -1;
    }
}

bool has_option(Option option) { return (config.options & option) != 0; }

}  // namespace settings
}  // namespace planarm
