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

Boot last_boot;

// Collects a payload's fields, little-endian.
class Fields {
  public:
    void u8(uint8_t byte) { *at_++ = byte; }

    void u16(uint16_t value) {
        u8(static_cast<uint8_t>(value));
        u8(static_cast<uint8_t>(value >> 8));
    }

    void u32(uint32_t value) {
        u16(static_cast<uint16_t>(value));
        u16(static_cast<uint16_t>(value >> 16));
    }

    void ledger(const motion::Ledger& ledger) {
        u32(ledger.executed_segments);
        for (int32_t usteps : ledger.position_usteps) u32(static_cast<uint32_t>(usteps));
    }

    const uint8_t* bytes() const { return bytes_; }
    uint8_t size() const { return static_cast<uint8_t>(at_ - bytes_); }

  private:
    uint8_t bytes_[MAX_PAYLOAD];
    uint8_t* at_ = bytes_;
};

// Stuffs bytes and carries their checksum on; returns where the next byte goes.
uint8_t* stuff(uint8_t* at, const uint8_t* bytes, uint8_t size, uint16_t& checksum) {
    uint16_t crc = checksum;
    for (; size != 0; --size) {
        uint8_t byte = *bytes++;
        crc = hal::crc_update(crc, byte);
        if (is_special(byte)) {
            *at++ = wire::ESCAPE;
            byte ^= wire::ESCAPE_XOR;
        }
        *at++ = byte;
    }
    checksum = crc;
    return at;
}

// Stuffs a checksum. The payload's starts from the header's, so `checksum` itself stays as it is.
uint8_t* stuff_checksum(uint8_t* at, uint16_t checksum) {
    const uint8_t bytes[] = {static_cast<uint8_t>(checksum), static_cast<uint8_t>(checksum >> 8)};
    return stuff(at, bytes, wire::CRC_BYTES, checksum);
}

uint8_t encode(uint8_t* encoded, uint8_t seq, wire::MessageType type, const Fields& payload) {
    const uint8_t header[wire::HEADER_BYTES] = {payload.size(), seq, static_cast<uint8_t>(type)};
    uint16_t checksum = wire::CRC_INITIAL;
    uint8_t* at = stuff(encoded, header, wire::HEADER_BYTES, checksum);
    at = stuff_checksum(at, checksum);
    at = stuff(at, payload.bytes(), payload.size(), checksum);
    at = stuff_checksum(at, checksum);
    *at++ = wire::DELIMITER;
    return static_cast<uint8_t>(at - encoded);
}

}  // namespace

void set_boot(const Boot& boot) { last_boot = boot; }

uint8_t welcome(uint8_t* encoded, const session::Report& report, uint32_t host_nonce) {
    static_assert(wire::WELCOME_BYTES == MAX_PAYLOAD && wire::WELCOME_BYTES >= wire::STATUS_BYTES,
                  "the buffer's size");
    Fields fields;
    fields.u8(wire::PROTOCOL_VERSION);
    fields.u32(host_nonce);
    fields.u32(last_boot.nonce);
    fields.u32(wire::SPEC_HASH);
    fields.u8(VERSION_MAJOR);
    fields.u8(VERSION_MINOR);
    fields.u8(VERSION_PATCH);
    fields.u8(static_cast<uint8_t>(last_boot.cause));
    fields.u8(last_boot.interrupted ? 1 : 0);
    fields.u8(wire::JOINTS);
    fields.ledger(motion::ledger());
    return encode(encoded, report.expected_seq, wire::MessageType::WELCOME, fields);
}

uint8_t status(uint8_t* encoded, const session::Report& report) {
    const motion::Ledger ledger = motion::ledger();
    Fields fields;
    fields.u8(static_cast<uint8_t>(supervisor::state()));
    fields.u8(static_cast<uint8_t>(supervisor::fault()));
    fields.u8(supervisor::fault_detail());
    fields.u8(static_cast<uint8_t>(report.refusal));
    fields.u8(report.refusal_seq);
    fields.u16(motion::free_bytes());
    fields.u8(report.crc_errors);
    fields.u8(hal::serial_overruns());
    fields.u8(hal::serial_ring_full());
    fields.u8(hal::hold_count());
    fields.u8(inputs::report());
    fields.u8(motion::override_percent());
    fields.u8(motion::rate_percent());
    fields.u32(ledger.ticks);
    fields.ledger(ledger);
    return encode(encoded, report.expected_seq, wire::MessageType::STATUS, fields);
}

}  // namespace reply
}  // namespace planarm
