#include "commands.h"

#include "hal_pins.h"
#include "hal_signals.h"
#include "home.h"
#include "motion.h"
#include "power.h"
#include "segment.h"
#include "step_engine.h"
#include "supervisor.h"

namespace planarm {
namespace commands {

using supervisor::Event;
using wire::MessageType;
using wire::Result;

namespace {

bool is_whole(const Reader& fields) { return fields.ok() && fields.at_end(); }

// Applies the event if the state takes it.
Result try_event(Event event, uint32_t now_ticks) {
    if (!supervisor::allows(event)) return Result::WRONG_STATE;
    supervisor::apply(event, now_ticks);
    return Result::OK;
}

Result enable(Reader& fields, uint32_t now_ticks) {
    const uint8_t on = fields.u8();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (on > 1) return Result::OUT_OF_RANGE;
    return try_event(on == 1 ? Event::ENABLE : Event::RELEASE, now_ticks);
}

Result start(Reader& fields, uint32_t now_ticks) {
    const uint32_t lead_ticks = fields.u32();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (lead_ticks < wire::MIN_LEAD_TICKS || lead_ticks > wire::MAX_SEGMENT_TICKS)
        return Result::OUT_OF_RANGE;
    if (motion::is_empty()) return Result::WRONG_STATE;
    const Result result = try_event(Event::START, now_ticks);
    if (result != Result::OK) return result;
    const uint32_t start_ticks = now_ticks + lead_ticks;
    const uint32_t ready_ticks = power::ready_ticks(now_ticks);
    motion::start(static_cast<int32_t>(start_ticks - ready_ticks) > 0 ? start_ticks : ready_ticks);
    return Result::OK;
}

Result clear(Reader& fields, uint32_t now_ticks) {
    if (!is_whole(fields)) return Result::MALFORMED;
    const Result result = try_event(Event::CLEAR, now_ticks);
    if (result == Result::OK) hal::emergency_clear();
    return result;
}

Result resume(Reader& fields, uint32_t now_ticks) {
    if (!is_whole(fields)) return Result::MALFORMED;
    supervisor::apply(Event::RESUME, now_ticks);
    return Result::OK;
}

Result stop(Reader& fields, uint32_t now_ticks) {
    const uint8_t quick = fields.u8();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (quick > 1) return Result::OUT_OF_RANGE;
    supervisor::apply(quick == 1 ? Event::QUICK_STOP : Event::STOP, now_ticks);
    return Result::OK;
}

Result set_override(Reader& fields) {
    const uint8_t percent = fields.u8();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (percent < 1 || percent > 100) return Result::OUT_OF_RANGE;
    motion::set_override(percent);
    return Result::OK;
}

Result config(Reader& fields, uint32_t now_ticks) {
    const uint8_t pin_map = fields.u8();
    const uint8_t joints = fields.u8();
    const uint8_t dir_inverted = fields.u8();
    power::Config power_config;
    power_config.options = fields.u8();
    power_config.idle_ms = fields.u32();
    power_config.wake_ticks = fields.u32();
    const uint16_t high_ticks = fields.u16();
    uint32_t start_stop_ticks[wire::JOINTS];
    for (uint32_t& ticks : start_stop_ticks) ticks = fields.u32();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (pin_map != wire::PIN_MAP_CODE || joints != wire::JOINTS || high_ticks > wire::MIN_STEP_HIGH_TICKS ||
        power_config.wake_ticks > wire::MAX_SEGMENT_TICKS) {
        return Result::OUT_OF_RANGE;
    }
    const Result result = try_event(Event::CONFIG, now_ticks);
    if (result != Result::OK) return result;
    power::configure(power_config);
    hal::watch_stop_input(power::has_option(power::STOP_INPUT));
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        motion::joints[joint].start_stop_ticks = start_stop_ticks[joint];
        step_engine::set_dir_inverted(joint, ((dir_inverted >> joint) & 1) != 0);
    }
    return Result::OK;
}

Result soft_limits(Reader& fields, uint32_t now_ticks) {
    int32_t least[wire::JOINTS];
    int32_t most[wire::JOINTS];
    for (int32_t& usteps : least) usteps = fields.i32();
    for (int32_t& usteps : most) usteps = fields.i32();
    if (!is_whole(fields)) return Result::MALFORMED;
    const Result result = try_event(Event::SOFT_LIMITS, now_ticks);
    if (result != Result::OK) return result;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        motion::joints[joint].least_usteps = least[joint];
        motion::joints[joint].most_usteps = most[joint];
    }
    return Result::OK;
}

Result set_position(Reader& fields, uint32_t now_ticks) {
    int32_t position[wire::JOINTS];
    for (int32_t& usteps : position) usteps = fields.i32();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (!motion::is_empty()) return Result::WRONG_STATE;
    const Result result = try_event(Event::SET_POSITION, now_ticks);
    if (result != Result::OK) return result;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) motion::set_position(joint, position[joint]);
    return Result::OK;
}

Result begin_home(Reader& fields, uint32_t now_ticks) {
    home::Order order;
    order.joint = fields.u8();
    const uint8_t positive = fields.u8();
    order.positive = positive == 1;
    order.fast_ticks = fields.u32();
    order.slow_ticks = fields.u32();
    order.most_usteps = fields.u32();
    order.back_usteps = fields.u32();
    if (!is_whole(fields)) return Result::MALFORMED;
    if (positive > 1 || home::check(order) != Result::OK) return Result::OUT_OF_RANGE;
    if (!power::has_option(power::LIMIT_SWITCHES)) return Result::WRONG_STATE;
    const Result result = try_event(Event::HOME, now_ticks);
    if (result == Result::OK) home::begin(order, power::ready_ticks(now_ticks) + wire::MIN_LEAD_TICKS);
    return result;
}

}  // namespace

Result execute(MessageType type, Reader& fields, uint32_t now_ticks) {
    switch (type) {
        case MessageType::QUERY:
            return is_whole(fields) ? Result::OK : Result::MALFORMED;
        case MessageType::ENABLE:
            return enable(fields, now_ticks);
        case MessageType::START:
            return start(fields, now_ticks);
        case MessageType::CLEAR:
            return clear(fields, now_ticks);
        case MessageType::RESUME:
            return resume(fields, now_ticks);
        case MessageType::STOP:
            return stop(fields, now_ticks);
        case MessageType::OVERRIDE:
            return set_override(fields);
        case MessageType::CONFIG:
            return config(fields, now_ticks);
        case MessageType::SOFT_LIMITS:
            return soft_limits(fields, now_ticks);
        case MessageType::SET_POSITION:
            return set_position(fields, now_ticks);
        case MessageType::HOME:
            return begin_home(fields, now_ticks);
        default:
            return Result::UNKNOWN_TYPE;
    }
}

}  // namespace commands
}  // namespace planarm
