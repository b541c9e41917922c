#include "reply.h"

#include "hal_base.h"
#include "hal_crc.h"
#include "hal_serial.h"
#include "hal_signals.h"
#include "inputs.h"
#include "motion.h"
#include "queue.h"
#include "supervisor.h"
#include "version.h"

namespace planarm {
namespace reply {

namespace {

struct Boot {
    uint32_t nonce;
    wire::Reset cause;
    bool interrupted;
};

Boot last_boot;

// The place of a message in the frame to be sent: what follows are the payload's checksum and the delimiter.
template <typename Message>
Message& payload() {
    return *reinterpret_cast<Message*>(hal::reply + hal::MAX_REPLY_BYTES - 1 - wire::CRC_BYTES -
                                       sizeof(Message));
}

// Writes the checksum of the bytes up to `at` there. The payload's goes on from the header's.
uint8_t* put_checksum(uint8_t* at, uint8_t bytes, uint16_t& crc) {
    for (const uint8_t* from = at - bytes; from != at;) crc = hal::crc_update(crc, *from++);
    *at++ = static_cast<uint8_t>(crc);
    *at++ = static_cast<uint8_t>(crc >> 8);
    return at;
}

void send(uint8_t seq, wire::MessageType type, uint8_t size) {
    const uint8_t frame = static_cast<uint8_t>(wire::HEADER_BYTES + 2 * wire::CRC_BYTES + 1 + size);
    uint8_t* at = hal::reply + hal::MAX_REPLY_BYTES - frame;
    *at++ = size;
    *at++ = seq;
    *at++ = static_cast<uint8_t>(type);
    uint16_t crc = wire::CRC_INITIAL;
    at = put_checksum(at, wire::HEADER_BYTES, crc);
    at = put_checksum(at + size, size, crc);
    *at = wire::DELIMITER;
    hal::serial_send(frame);
}

}  // namespace

void set_boot(uint32_t nonce, wire::Reset cause, bool interrupted) {
    hal::by_base(last_boot) = {nonce, cause, interrupted};
}

void send_welcome(const session::Report& report, uint32_t host_nonce) {
    wire::Welcome& told = payload<wire::Welcome>();
    told.protocol_version = wire::PROTOCOL_VERSION;
    told.host_nonce = host_nonce;
    const Boot& boot = hal::by_base(last_boot);
    told.boot_nonce = boot.nonce;
    told.spec_hash = wire::SPEC_HASH;
    told.firmware_version[0] = VERSION_MAJOR;
    told.firmware_version[1] = VERSION_MINOR;
    told.firmware_version[2] = VERSION_PATCH;
    told.reset_cause = boot.cause;
    told.interrupted = boot.interrupted ? 1 : 0;
    told.joints = wire::JOINTS;
    motion::tell_ledger(told.ledger);
    send(report.expected_seq, wire::MessageType::WELCOME, sizeof(told));
}

void send_status(const session::Report& report) {
    wire::Status& told = payload<wire::Status>();
    told.mcu_ticks = motion::tell_ledger(told.ledger);
    told.state = supervisor::state();
    told.fault = supervisor::tell_fault();
    told.detail = supervisor::fault_detail();
    told.refusal = report.refusal;
    told.refusal_seq = report.refusal_seq;
    told.free_bytes = queue::free_bytes();
    told.crc_errors = report.crc_errors;
    told.overruns = hal::serial_overruns();
    told.ring_full = hal::serial_ring_full();
    told.holds = hal::hold_count();
    told.inputs = inputs::report();
    told.override_percent = motion::override_percent();
    told.rate_percent = motion::rate_percent();
    send(report.expected_seq, wire::MessageType::STATUS, sizeof(told));
}

}  // namespace reply
}  // namespace planarm
