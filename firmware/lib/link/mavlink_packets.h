// The generated MAVLink headers, as this library uses them: structs and packing only, none of their global state.
#pragma once

#define MAVLINK_COMM_NUM_BUFFERS 1
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
// An array of BATTERY_STATUS stands at an odd address; car_messages.cpp packs it without the function that says so. GCC 8
// does not know that warning.
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Waddress-of-packed-member"
#include <foldcar/mavlink.h>
#pragma GCC diagnostic pop
