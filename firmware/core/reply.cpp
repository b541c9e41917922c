#include "reply.h"

#include "framing.h"
#include "hal_crc.h"
#include "hal_serial.h"
#include "hal_signals.h"
#include "inputs.h"
#include "motion.h"
#include "supervisor.h"
#include "version.h"

namespace planarm {
namespace reply {

namespace {

constexpr uint8_t MAX_PAYLOAD = wire::WELCOME_BYTES;
static_assert(wire::WELCOME_BYTES >= wire::STATUS_BYTES, "the longest reply");
// Before the payload is read, and behind it; every byte but the delimiter may be stuffed.
constexpr uint8_t MAX_HEAD = 2 * (wire::HEADER_BYTES + wire::CRC_BYTES);
constexpr uint8_t MAX_TAIL = 2 * wire::CRC_BYTES + 1;

Boot last_boot;

// The frame as it is sent, from `line` on. It is stuffed from the payload in the same memory: writing two
// bytes for each one that it reads, it has come as far as the payload's end when it has read it all.
union {
    uint8_t line[MAX_HEAD + 2 * MAX_PAYLOAD + MAX_TAIL];
    struct {
        uint8_t before[MAX_HEAD + MAX_PAYLOAD];
        union {
            wire::Welcome welcome;
            wire::Status status;
        };
    } plain;
} buffer;

uint8_t* end;  // of what is stuffed
uint16_t crc;

void stuff(uint8_t byte) {
    crc = hal::crc_update(crc, byte);
    if (is_special(byte)) {
        *end++ = wire::ESCAPE;
        byte ^= wire::ESCAPE_XOR;
    }
    *end++ = byte;
}

// The payload's checksum goes on from the header's, so it stays as it is.
void stuff_checksum() {
    const uint16_t told = crc;
    stuff(static_cast<uint8_t>(told));
    stuff(static_cast<uint8_t>(told >> 8));
    crc = told;
}

void send(uint8_t seq, wire::MessageType type, uint8_t size) {
    const uint8_t* payload = reinterpret_cast<const uint8_t*>(&buffer.plain.status);
    end = buffer.line;
    crc = wire::CRC_INITIAL;
    stuff(size);
    stuff(seq);
    stuff(static_cast<uint8_t>(type));
    stuff_checksum();
    for (; size != 0; --size) stuff(*payload++);
    stuff_checksum();
    *end++ = wire::DELIMITER;
    hal::serial_send(buffer.line, static_cast<uint8_t>(end - buffer.line));
}

}  // namespace

void set_boot(const Boot& boot) { last_boot = boot; }

void send_welcome(const session::Report& report, uint32_t host_nonce) {
    wire::Welcome& told = buffer.plain.welcome;
    told.protocol_version = wire::PROTOCOL_VERSION;
    told.host_nonce = host_nonce;
    told.boot_nonce = last_boot.nonce;
    told.spec_hash = wire::SPEC_HASH;
    told.firmware_version[0] = VERSION_MAJOR;
    told.firmware_version[1] = VERSION_MINOR;
    told.firmware_version[2] = VERSION_PATCH;
    told.reset_cause = last_boot.cause;
    told.interrupted = last_boot.interrupted ? 1 : 0;
    told.joints = wire::JOINTS;
    motion::tell_ledger(told.ledger);
    send(report.expected_seq, wire::MessageType::WELCOME, sizeof(told));
}

void send_status(const session::Report& report) {
    wire::Status& told = buffer.plain.status;
    told.mcu_ticks = motion::tell_ledger(told.ledger);
    told.state = supervisor::state();
    told.fault = supervisor::fault();
    hal::emergency_told();
    told.detail = supervisor::fault_detail();
    told.refusal = report.refusal;
    told.refusal_seq = report.refusal_seq;
    told.free_bytes = motion::free_bytes();
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
