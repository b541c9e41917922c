#include "commands.h"

#include "clock.h"
#include "hal_flash.h"
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

// What is queued was checked against the limits of before.
Result soft_limits(const wire::SoftLimits& told) {
    if (!queue::is_empty()) return Result::WRONG_STATE;
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

// Bytes of the payloads, from QUERY on. SEGMENTS, which is no command, has a length that none has.
const uint16_t LENGTHS[] HAL_FLASH = {
    wire::QUERY_BYTES,       wire::ENABLE_BYTES, 0xFF,
    wire::START_BYTES,       wire::CLEAR_BYTES,  wire::RESUME_BYTES,
    wire::OVERRIDE_BYTES,    wire::STOP_BYTES,   wire::CONFIG_BYTES,
    wire::SOFT_LIMITS_BYTES, wire::HOME_BYTES,   wire::SET_POSITION_BYTES,
};
constexpr uint8_t COMMANDS = sizeof(LENGTHS) / sizeof(LENGTHS[0]);
constexpr uint8_t FIRST = static_cast<uint8_t>(MessageType::QUERY);
static_assert(static_cast<uint8_t>(MessageType::SEGMENTS) == FIRST + 2 &&
                  static_cast<uint8_t>(MessageType::OVERRIDE) == FIRST + 6 &&
                  static_cast<uint8_t>(MessageType::SET_POSITION) == FIRST + COMMANDS - 1,
              "the order of the lengths");

}  // namespace

Result execute(const Frame& frame) {
    const uint8_t number = static_cast<uint8_t>(frame.type - FIRST);
    if (number >= COMMANDS) return Result::UNKNOWN_TYPE;
    if (hal::flash_word(&LENGTHS[number]) != frame.length) return Result::MALFORMED;
    switch (static_cast<MessageType>(frame.type)) {
        case MessageType::ENABLE:
            return enable(frame.as<wire::Enable>());
        case MessageType::START:
            return start(frame.as<wire::Start>());
        case MessageType::CLEAR:
            return clear();
        case MessageType::RESUME:
            supervisor::apply(Event::RESUME);
            return Result::OK;
        case MessageType::STOP:
            return stop(frame.as<wire::Stop>());
        case MessageType::OVERRIDE:
            return set_override(frame.as<wire::Override>());
        case MessageType::CONFIG:
            return config(frame.as<wire::Config>());
        case MessageType::SOFT_LIMITS:
            return soft_limits(frame.as<wire::SoftLimits>());
        case MessageType::SET_POSITION:
            return set_position(frame.as<wire::SetPosition>());
        case MessageType::HOME:
            return begin_home(frame.as<wire::Home>());
        default:
            return Result::OK;  // QUERY
    }
}

}  // namespace commands
}  // namespace planarm
