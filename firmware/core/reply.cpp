#include "reply.h"

#include "crc.h"
#include "framing.h"
#include "hal_serial.h"
#include "motion.h"
#include "supervisor.h"
#include "version.h"

namespace planarm {
namespace reply {

namespace {

uint32_t boot_nonce;

// Encodes one frame: little-endian fields, stuffing, both checksums.
class FrameWriter {
  public:
    FrameWriter(uint8_t* encoded, uint8_t seq, wire::MessageType type, uint8_t length)
        : begin_(encoded), at_(encoded) {
        u8(length);
        u8(seq);
        u8(static_cast<uint8_t>(type));
        checksum();
    }

    void u8(uint8_t byte) {
        crc_ = crc_update(crc_, byte);
        stuff(byte);
    }

    void u32(uint32_t value) {
        for (uint8_t i = 0; i < 4; ++i) {
            u8(static_cast<uint8_t>(value));
            value >>= 8;
        }
    }

    void ledger(const motion::Ledger& ledger) {
        u32(ledger.executed_segments);
        for (int32_t usteps : ledger.position_usteps) u32(static_cast<uint32_t>(usteps));
    }

    uint8_t finish() {
        checksum();
        *at_++ = wire::DELIMITER;
        return static_cast<uint8_t>(at_ - begin_);
    }

  private:
    // The payload's checksum starts from the header's, which is what `crc_` holds after it.
    void checksum() {
        stuff(static_cast<uint8_t>(crc_));
        stuff(static_cast<uint8_t>(crc_ >> 8));
    }

    void stuff(uint8_t byte) {
        if (is_special(byte)) {
            *at_++ = wire::ESCAPE;
            byte ^= wire::ESCAPE_XOR;
        }
        *at_++ = byte;
    }

    uint8_t* const begin_;
    uint8_t* at_;
    uint16_t crc_ = wire::CRC_INITIAL;
};

}  // namespace

void set_boot_nonce(uint32_t nonce) { boot_nonce = nonce; }

uint8_t welcome(uint8_t* encoded, const session::Report& report, uint32_t host_nonce) {
    constexpr uint8_t LENGTH = 1 + 4 + 4 + 4 + 3 + 4 + 4 * wire::JOINTS;
    static_assert(LENGTH <= MAX_PAYLOAD, "buffer for replies");
    FrameWriter frame(encoded, report.expected_seq, wire::MessageType::WELCOME, LENGTH);
    frame.u8(wire::PROTOCOL_VERSION);
    frame.u32(host_nonce);
    frame.u32(boot_nonce);
    frame.u32(wire::SPEC_HASH);
    frame.u8(VERSION_MAJOR);
    frame.u8(VERSION_MINOR);
    frame.u8(VERSION_PATCH);
    frame.ledger(motion::ledger());
    return frame.finish();
}

uint8_t status(uint8_t* encoded, const session::Report& report) {
    constexpr uint8_t LENGTH = 8 + 4 + 4 + 4 * wire::JOINTS;
    static_assert(LENGTH <= MAX_PAYLOAD, "buffer for replies");
    FrameWriter frame(encoded, report.expected_seq, wire::MessageType::STATUS, LENGTH);
    const motion::Ledger ledger = motion::ledger();
    frame.u8(static_cast<uint8_t>(supervisor::state()));
    frame.u8(static_cast<uint8_t>(supervisor::fault()));
    frame.u8(static_cast<uint8_t>(report.refusal));
    frame.u8(report.refusal_seq);
    frame.u8(motion::free_slots());
    frame.u8(report.crc_errors);
    frame.u8(hal::serial_overruns());
    frame.u8(hal::serial_ring_full());
    frame.u32(ledger.ticks);
    frame.ledger(ledger);
    return frame.finish();
}

}  // namespace reply
}  // namespace planarm
