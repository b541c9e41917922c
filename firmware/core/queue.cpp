#include "queue.h"

#include "hal_base.h"

namespace planarm {
namespace queue {

namespace {

struct Queue {
    uint8_t* write_at;
    const uint8_t* read_at;
    uint16_t used_bytes;
};

Queue state;
uint8_t ring[wire::QUEUE_BYTES];

Queue& current() { return hal::by_base(state); }

const uint8_t* const RING_END = ring + wire::QUEUE_BYTES;

const uint8_t* after(const uint8_t* at, uint8_t bytes) {
    at += bytes;
    return at >= RING_END ? at - wire::QUEUE_BYTES : at;
}

}  // namespace

void clear() {
    Queue& at = current();
    at.write_at = ring;
    at.read_at = ring;
    at.used_bytes = 0;
}

bool is_empty() { return current().used_bytes == 0; }

uint16_t free_bytes() {
    const uint16_t room = static_cast<uint16_t>(wire::QUEUE_BYTES - current().used_bytes);
    return room < wire::QUEUE_FRAME_BYTES ? 0 : static_cast<uint16_t>(room - wire::QUEUE_FRAME_BYTES);
}

void append(const uint8_t* payload, uint8_t length) {
    Queue& at = current();
    at.used_bytes = static_cast<uint16_t>(at.used_bytes + length + wire::QUEUE_FRAME_BYTES);
    uint8_t* to = at.write_at;
    uint8_t byte = length;
    for (;; --length) {
        *to++ = byte;
        if (to == RING_END) to = ring;
        if (length == 0) break;
        byte = *payload++;
    }
    at.write_at = to;
}

void read_front(Reader& reader) {
    const uint8_t* at = current().read_at;
    reader.begin(after(at, 1), *at, ring, RING_END);
}

void release() {
    Queue& at = current();
    const uint8_t bytes = static_cast<uint8_t>(*at.read_at + wire::QUEUE_FRAME_BYTES);
    at.read_at = after(at.read_at, bytes);
    at.used_bytes = static_cast<uint16_t>(at.used_bytes - bytes);
}

}  // namespace queue
}  // namespace planarm
