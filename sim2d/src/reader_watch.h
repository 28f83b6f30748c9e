// Ends the program when nothing reads its output any more: with the process that started it, however that ends.
#pragma once

namespace foldcar {

// Watches standard output from now on, in a thread of its own, if it is a pipe or a socket.
void end_without_reader();

}  // namespace foldcar
