// The generated MAVLink headers, as this library uses them: structs and packing only, none of their global state.
#pragma once

#define MAVLINK_COMM_NUM_BUFFERS 1
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <foldcar/mavlink.h>
#pragma GCC diagnostic pop
