#include "commands.h"

#include "clock.h"
#include "hal_pins.h"
#include "hal_signals.h"
#include "home.h"
#include "intake.h"
#include "motion.h"
#include "power.h"
#include "queue.h"
#include "settings.h"
#include "step_engine.h"
#include "supervisor.h"

namespace planarm {
namespace commands {

using supervisor::Event;
using wire::MessageType;
using wire::Result;

namespace {

// Applies the event if the state takes it.
Result try_event(Event event) {
    if (!supervisor::allows(event)) return Result::WRONG_STATE;
    supervisor::apply(event);
    return Result::OK;
}

Result enable(const wire::Enable& told) {
    if (told.on > 1) return Result::OUT_OF_RANGE;
    return try_event(told.on == 1 ? Event::ENABLE : Event::RELEASE);
}

Result start(const wire::Start& told) {
    if (told.lead_ticks < wire::MIN_LEAD_TICKS || told.lead_ticks > wire::MAX_SEGMENT_TICKS)
        return Result::OUT_OF_RANGE;
    if (queue::is_empty()) return Result::WRONG_STATE;
    const Result result = try_event(Event::START);
    if (result != Result::OK) return result;
    const uint32_t start_ticks = clock::pass_ticks() + told.lead_ticks;
    const uint32_t ready_ticks = power::ready_ticks();
    motion::start(static_cast<int32_t>(start_ticks - ready_ticks) > 0 ? start_ticks : ready_ticks);
    return Result::OK;
}

Result clear() {
    const Result result = try_event(supervisor::clear_event());
    if (result == Result::OK) hal::emergency_clear();
    return result;
}

Result resume() {
    supervisor::apply(Event::RESUME);
    return Result::OK;
}

Result stop(const wire::Stop& told) {
    if (told.quick > 1) return Result::OUT_OF_RANGE;
    supervisor::apply(told.quick == 1 ? Event::QUICK_STOP : Event::STOP);
    return Result::OK;
}

Result set_override(const wire::Override& told) {
    if (told.percent < 1 || told.percent > 100) return Result::OUT_OF_RANGE;
    motion::set_override(told.percent);
    return Result::OK;
}

Result config(const wire::Config& told) {
    if (static_cast<uint8_t>(told.pin_map) != wire::PIN_MAP_CODE || told.joints != wire::JOINTS ||
        told.high_ticks > wire::MIN_STEP_HIGH_TICKS || told.wake_ticks > wire::MAX_SEGMENT_TICKS) {
        return Result::OUT_OF_RANGE;
    }
    const Result result = try_event(Event::CONFIG);
    if (result != Result::OK) return result;
    settings::config = told;
    power::configure();
    hal::watch_stop_input(settings::has_option(settings::STOP_INPUT));
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        step_engine::set_dir_inverted(joint, ((told.dir_inverted >> joint) & 1) != 0);
    }
    return Result::OK;
}

Result soft_limits(const wire::SoftLimits& told) {
    const Result result = try_event(Event::SOFT_LIMITS);
    if (result == Result::OK) settings::soft_limits = told;
    return result;
}

Result set_position(const wire::SetPosition& told) {
    if (!queue::is_empty()) return Result::WRONG_STATE;
    const Result result = try_event(Event::SET_POSITION);
    if (result != Result::OK) return result;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        step_engine::set_position(joint, told.position_usteps[joint]);
        intake::set_position(joint, told.position_usteps[joint]);
    }
    return Result::OK;
}

Result begin_home(const wire::Home& told) {
    if (!home::is_good(told)) return Result::OUT_OF_RANGE;
    if (!settings::has_option(settings::LIMIT_SWITCHES)) return Result::WRONG_STATE;
    const Result result = try_event(Event::HOME);
    if (result == Result::OK) home::begin(told, power::ready_ticks() + wire::MIN_LEAD_TICKS);
    return result;
}

template <typename Message>
Result run(Result (*carry_out)(const Message&), const Frame& frame) {
    return frame.length == sizeof(Message) ? carry_out(frame.as<Message>()) : Result::MALFORMED;
}

Result run(Result (*carry_out)(), const Frame& frame) {
    return frame.length == 0 ? carry_out() : Result::MALFORMED;
}

Result query() { return Result::OK; }

}  // namespace

Result execute(const Frame& frame) {
    switch (static_cast<MessageType>(frame.type)) {
        case MessageType::QUERY:
            return run(query, frame);
        case MessageType::ENABLE:
            return run(enable, frame);
        case MessageType::START:
            return run(start, frame);
        case MessageType::CLEAR:
            return run(clear, frame);
        case MessageType::RESUME:
            return run(resume, frame);
        case MessageType::STOP:
            return run(stop, frame);
        case MessageType::OVERRIDE:
            return run(set_override, frame);
        case MessageType::CONFIG:
            return run(config, frame);
        case MessageType::SOFT_LIMITS:
            return run(soft_limits, frame);
        case MessageType::SET_POSITION:
            return run(set_position, frame);
        case MessageType::HOME:
            return run(begin_home, frame);
        default:
            return Result::UNKNOWN_TYPE;
    }
}

}  // namespace commands
}  // namespace planarm
