// vsplat-read: reads one mesh or HDF5 file for the library, which starts it (model/io/reader/README.md).
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "model/io/reader/program/confine.h"
#include "model/io/reader/program/hdf5.h"
#include "model/io/reader/program/library.h"
#include "model/io/reader/program/read_mesh.h"

namespace {

using namespace vsplat::read;
using vsplat::Status;

constexpr int socket_number = 3;

bool is_started_by_the_library(int count) {
  int type = 0;
  socklen_t size = sizeof type;
  return count == 3 && ::getsockopt(socket_number, SOL_SOCKET, SO_TYPE, &type, &size) == 0 && type == SOCK_STREAM;
}

// Serves requests until an exception ends the connection.
void serve(Library& library, Hdf5& hdf5) {
  for (;;) {
    const Message asked = library.asked();
    Unpacker in(asked.body);
    limit_time(in.get<std::uint32_t>());
    watch_memory();
    try {
      if (asked.kind == Kind::mesh) {
        read_mesh(in.text(), library);
      } else {
        hdf5.answer(asked.kind, in);
      }
    } catch (const Wrong& wrong) {
      library.say(wrong);
    } catch (const std::bad_alloc&) {
      library.say(short_of_memory());
    } catch (const std::exception& e) {
      library.say({Status::format, "", e.what()});
    }
    limit_time(0);
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (!is_started_by_the_library(count)) {
    std::fputs("vsplat-read: reads meshes and HDF5 files for the library of vsplat, which starts it\n", stderr);
    return 2;
  }
  const bool one_mesh = std::string(arguments[1]) == "mesh";
  Library library(socket_number);
  Hdf5 hdf5(library);
  const std::uint32_t confined = confine(std::strtoull(arguments[2], nullptr, 10), one_mesh);
  try {
    library.say(Kind::hello, Packer().text(version()).put(confined));
    serve(library, hdf5);
  } catch (const std::exception&) {  // the library is gone, or sends an invalid message
  }
  ::_exit(0);  // skips all cleanup
}
