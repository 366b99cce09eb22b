#include "model/io/reader/reader.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "model/data/mesh_file.h"
#include "model/io/archive/hdf5_file.h"
#include "model/io/reader/start_program.h"
#include "runtime/files/file.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {
namespace {

// An empty mesh and an empty HDF5 file; the reader's messages determine their content.
class Files {
 public:
  Files() {
    std::string name = (std::filesystem::temp_directory_path() / "vsplat-fuzz-XXXXXX").string();
    hold(::mkdtemp(name.data()) != nullptr, "a folder");
    folder_ = name;
    for (const std::string& path : {mesh(), hdf5()}) write_file(path, "", 0);
  }
  ~Files() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  Files(const Files&) = delete;
  Files& operator=(const Files&) = delete;
  std::string mesh() const { return folder_ + "/a.gltf"; }
  std::string hdf5() const { return folder_ + "/a.h5"; }

 private:
  std::string folder_;
};

// The end of a socket on which `words` were sent after the reader's usual first message.
read::Started spoken(std::string_view words) {
  int ends[2] = {-1, -1};
  hold(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0, "a socket");
  read::Channel other{read::Descriptor(ends[1])};
  other.send(read::Kind::hello, read::Packer().text(read::version()).put(std::uint32_t{0}));
  const ssize_t sent = ::send(ends[1], words.data(), words.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  hold(sent == static_cast<ssize_t>(words.size()), "room for what is said");
  ::shutdown(ends[1], SHUT_WR);
  static read::Channel kept{read::Descriptor()};  // until the next call, because requests must go somewhere
  kept = std::move(other);
  return {"the fuzzer", -1, ends[0]};
}

void check(const Mesh& mesh) {
  hold(mesh.triangles() > 0 && mesh.corners.size() == 3 * mesh.triangles(), "sizes");
  for (const std::uint32_t material : mesh.materials) hold(material < mesh.palette.size(), "materials");
  for (const Corner& c : mesh.corners)
    hold(c.position.allFinite() && c.normal.allFinite() && c.colour.allFinite() && c.uv.allFinite() &&
             c.emission_uv.allFinite() && std::isfinite(c.alpha),
         "finite");
  for (const Material& m : mesh.palette)
    hold(m.colour.allFinite() && m.emission.allFinite() && (!m.texture || m.texture->width > 0), "materials");
}

void ask(const Hdf5File& file) {
  for (const Hdf5File::Link& link : file.links("/")) hold(link.name.size() <= 65536, "a name");
  const std::vector<long> shape = file.shape("a");
  hold(shape.size() <= 8, "a shape");
  hold(file.bytes("a", {2, 2, 4}).size() == 16, "so many bytes");
  hold(file.numbers("a", {2}).size() == 2, "so many numbers");
}

}  // namespace

void reader(std::string_view bytes) {
  static const Files files;
  const bool mesh = bytes.empty() || bytes.front() != 'h';
  const std::string path = mesh ? files.mesh() : files.hdf5();
  const std::string_view words = bytes.substr(std::min<std::size_t>(bytes.size(), 1));
  ReaderLimits limits;
  limits.seconds = 0.5;
  set_reader_limits(limits);
  read::set_start_program([words](const char*, std::uint64_t) { return spoken(words); });
  try {
    if (mesh)
      check(load_mesh(path));
    else
      ask(Hdf5File(path));
  } catch (const Error& e) {
    hold_message(e, path.substr(0, path.rfind('/')));  // a texture is beside it
  }
  read::set_start_program({});
  set_reader_limits({});
}

}  // namespace vsplat::fuzz
