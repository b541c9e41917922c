#include "journal.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/crc16.h>

#include "hal_journal.h"
#include "hal_step_timer.h"
#include "polarity.h"

namespace hal {

namespace {

constexpr uint8_t RECORDS = 128;
constexpr uint8_t RECORD_BYTES = 4;
constexpr uint8_t CHECK_START = 0x5A;  // neither an erased nor a cleared EEPROM passes the check
constexpr uint32_t SEQUENCE_MASK = 0x7FFFFF;

uint32_t sequence;
uint8_t slot;  // of the newest record
uint8_t record[RECORD_BYTES];
uint8_t unwritten;  // bytes of the newest record

bool is_ready() { return (EECR & _BV(EEPE)) == 0; }

uint8_t read_byte(uint16_t address) {
    while (!is_ready()) {
    }
    EEAR = address;
    EECR |= _BV(EERE);
    return EEDR;
}

// The EEPROM must be ready.
void write_byte(uint16_t address, uint8_t value) {
    EEAR = address;
    EEDR = value;
    const InterruptLock lock;  // EEPE has to follow EEMPE within four cycles (ATmega328P datasheet, 7.6.3)
    EECR |= _BV(EEMPE);
    EECR |= _BV(EEPE);
}

uint8_t check_of(const uint8_t* bytes) {
    uint8_t check = CHECK_START;
    for (uint8_t i = 0; i < RECORD_BYTES - 1; ++i) check = _crc8_ccitt_update(check, bytes[i]);
    return check;
}

// False when the record does not pass its check.
bool read_record(uint8_t index, uint32_t& told_sequence, bool& enabled) {
    uint8_t bytes[RECORD_BYTES];
    for (uint8_t i = 0; i < RECORD_BYTES; ++i) {
        bytes[i] = read_byte(static_cast<uint16_t>(index * RECORD_BYTES + i));
    }
    const uint16_t low = static_cast<uint16_t>(bytes[0] | (bytes[1] << 8));
    told_sequence = low | (static_cast<uint32_t>(bytes[2] & 0x7F) << 16);
    enabled = (bytes[2] & 0x80) != 0;
    return bytes[RECORD_BYTES - 1] == check_of(bytes);
}

// The newest is the one that the others are behind of, modulo 2^23.
bool find_newest() {
    bool found = false;
    bool was_enabled = false;
    for (uint8_t index = 0; index < RECORDS; ++index) {
        uint32_t candidate;
        bool enabled;
        if (!read_record(index, candidate, enabled)) continue;
        const uint32_t ahead = (candidate - sequence) & SEQUENCE_MASK;
        if (found && (ahead == 0 || ahead > SEQUENCE_MASK / 2)) continue;
        found = true;
        sequence = candidate;
        slot = index;
        was_enabled = enabled;
    }
    return was_enabled;
}

// A record that is still being written is written anew in its place: a mark never waits for another.
void begin_record(bool enabled) {
    if (unwritten == 0) {
        sequence = (sequence + 1) & SEQUENCE_MASK;
        slot = static_cast<uint8_t>((slot + 1) % RECORDS);
    }
    record[0] = static_cast<uint8_t>(sequence);
    record[1] = static_cast<uint8_t>(sequence >> 8);
    record[2] = static_cast<uint8_t>((sequence >> 16) | (enabled ? 0x80 : 0));
    record[3] = check_of(record);
    unwritten = RECORD_BYTES;
}

}  // namespace

JournalBoot journal_boot() {
    const bool was_enabled = find_newest();
    begin_record(false);
    while (unwritten != 0) journal_serve();
    while (!is_ready()) {
    }
    return {sequence, was_enabled};
}

void journal_mark(bool enabled) { begin_record(enabled); }

void journal_serve() {
    if (unwritten == 0 || !is_ready()) return;
    --unwritten;
    write_byte(static_cast<uint16_t>(slot * RECORD_BYTES + unwritten), record[unwritten]);
}

void keep_enable_polarity(bool active_high) {
    const uint8_t wanted = active_high ? ACTIVE_HIGH : 0xFF;
    if (read_byte(POLARITY_ADDRESS) == wanted) return;
    write_byte(POLARITY_ADDRESS, wanted);
}

}  // namespace hal
