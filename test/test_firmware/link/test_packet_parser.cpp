// The search for packets in a stream of bytes.
#include "../../suite.h"

#include <string>

#include "link_bench.h"
#include "packet_parser.h"

using namespace foldcar;

TEST(packets_are_found_among_noise_and_behind_false_starts) {
  MavlinkHost host;
  const std::string packet = host.heartbeat();
  const std::string false_start = std::string("\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00", 10);  // of a HEARTBEAT
  const std::string impossible = std::string("\xfd\xff\x00\x00\x00\x01\x01\x00\x00\x00", 10);   // too long for one
  for (const std::string& noise : {std::string("noise\xfd"), false_start, impossible, packet.substr(0, 15)}) {
    PacketParser parser;
    mavlink_message_t message;
    const std::string bytes = noise + packet + packet;
    const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
    TEST_ASSERT_EQUAL_UINT(bytes.size(), parser.feed(data, bytes.size(), 0));
    int found = 0;
    while (parser.next(message, 0)) ++found;
    TEST_ASSERT_EQUAL_INT(2, found);
    TEST_ASSERT_EQUAL_UINT(noise.size(), parser.bad_byte_count());
  }
}

// A false start at the length of a packet is given up after 100 ms, and the packet behind it is found.
TEST(an_unfinished_packet_does_not_hold_up_the_next_for_long) {
  MavlinkHost host;
  const std::string start = std::string("\xfd\x21\x00\x00\x00\x01\x01\x4c\x00\x00", 10);  // a COMMAND_LONG of 33 bytes
  const std::string bytes = start + host.heartbeat();
  PacketParser parser;
  mavlink_message_t message;
  parser.feed(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), 0);
  TEST_ASSERT_FALSE(parser.next(message, 99999));
  TEST_ASSERT_TRUE(parser.next(message, 100000));
  TEST_ASSERT_EQUAL_UINT32(MAVLINK_MSG_ID_HEARTBEAT, message.msgid);
}
