#include "queue.h"

namespace planarm {
namespace queue {

namespace {

uint8_t ring[wire::QUEUE_BYTES];
uint8_t* write_at;
const uint8_t* read_at;
uint16_t used_bytes;

const uint8_t* const RING_END = ring + wire::QUEUE_BYTES;

void put(uint8_t byte) {
    *write_at++ = byte;
    if (write_at == RING_END) write_at = ring;
}

const uint8_t* after(const uint8_t* at, uint8_t bytes) {
    at += bytes;
    return at >= RING_END ? at - wire::QUEUE_BYTES : at;
}

}  // namespace

void clear() {
    write_at = ring;
    read_at = ring;
    used_bytes = 0;
}

bool is_empty() { return used_bytes == 0; }

uint16_t free_bytes() {
    const uint16_t room = static_cast<uint16_t>(wire::QUEUE_BYTES - used_bytes);
    return room < wire::QUEUE_FRAME_BYTES ? 0 : static_cast<uint16_t>(room - wire::QUEUE_FRAME_BYTES);
}

void append(const uint8_t* payload, uint8_t length) {
    put(length);
    for (uint8_t i = 0; i < length; ++i) put(payload[i]);
    used_bytes = static_cast<uint16_t>(used_bytes + length + wire::QUEUE_FRAME_BYTES);
}

void read_front(Reader& reader) { reader.begin(after(read_at, 1), *read_at, ring, RING_END); }

void release() {
    const uint8_t length = *read_at;
    read_at = after(after(read_at, 1), length);
    used_bytes = static_cast<uint16_t>(used_bytes - length - wire::QUEUE_FRAME_BYTES);
}

}  // namespace queue
}  // namespace planarm
