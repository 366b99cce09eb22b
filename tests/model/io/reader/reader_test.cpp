// The reader's process: its restrictions, and the results of a crash, silence or invalid messages.
#include "model/io/reader/reader.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>

#include "model/data/mesh_file.h"
#include "model/io/archive/hdf5_file.h"
#include "model/io/reader/mesh_messages.h"
#include "model/io/reader/sanitized.h"
#include "model/io/reader/start_program.h"
#include "tests/support/hdf5_writer.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using read::Channel;
using read::Descriptor;
using read::Kind;
using read::MeshCorner;
using read::Packer;
using test::expect_error;
using test::put_file;
using test::TemporaryFolder;

constexpr const char* triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

// While this lives, another program replaces the reader, or the messages of `speak` do.
class Instead {
 public:
  explicit Instead(const std::string& program) : program_(VSPLAT_READER) { set_reader_program(program); }
  explicit Instead(const std::function<void(Channel&)>& speak) : program_(VSPLAT_READER) {
    read::set_start_program([this, speak](const char*, std::uint64_t) {
      int ends[2] = {-1, -1};
      EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
      other_ = std::make_unique<Channel>(Descriptor(ends[1]));
      end = ends[1];
      other_->send(Kind::hello, Packer().text(read::version()).put(std::uint32_t{0}));
      speak(*other_);
      return read::Started{"the test", -1, ends[0]};
    });
  }
  ~Instead() {
    set_reader_program(program_);
    read::set_start_program({});
    set_reader_limits({});
  }
  Instead(const Instead&) = delete;
  Instead& operator=(const Instead&) = delete;

  static inline int end = -1;  // the reader's end of the socket

 private:
  std::string program_;
  std::unique_ptr<Channel> other_;
};

// A program that starts like the reader and then does something else.
std::string script(const TemporaryFolder& folder, const std::string& body,
                   const std::string& version = read::version()) {
  const std::string path = folder / "reader.sh";
  const auto octal = [](std::size_t value) { return fmt::format("\\{:03o}\\000\\000\\000", value); };
  put_file(path,
           fmt::format(
               "#!/bin/sh\nprintf 'VSPR{}{}\\000\\000\\000\\000{}\\000\\000\\000\\000{}\\000\\000\\000\\000' >&3\n{}\n",
               octal(100), octal(version.size() + 12), octal(version.size()), version, body));
  EXPECT_EQ(::chmod(path.c_str(), 0700), 0);
  return path;
}

std::string line_of(pid_t process, const char* file, const std::string& begin) {
  std::string text = test::contents_of(fmt::format("/proc/{}/{}", process, file));
  const std::size_t at = text.find(begin);
  return at == std::string::npos ? "" : text.substr(at, text.find('\n', at) - at);
}

TEST(Reader, IsConfined) {
  const TemporaryFolder folder;
  test::Hdf5Writer(folder / "a.h5").numbers("x", {2}, {1, 2});
  const Reader reader(folder / "a.h5", Kind::hdf5, "its file");
  const pid_t process = reader.process();
  EXPECT_NE(line_of(process, "status", "NoNewPrivs").find('1'), std::string::npos);
  if (fs::exists("/proc/sys/kernel/seccomp")) {
    EXPECT_NE(line_of(process, "status", "Seccomp:").find('2'), std::string::npos);
  }
  EXPECT_NE(line_of(process, "limits", "Max core file size").find(" 0 "), std::string::npos);
  EXPECT_NE(line_of(process, "limits", "Max file size").find(" 0 "), std::string::npos);
  EXPECT_NE(line_of(process, "limits", "Max open files").find(" 64 "), std::string::npos);
  if (!read::sanitized) {
    EXPECT_NE(line_of(process, "limits", "Max address space").find(std::to_string(768 << 20)), std::string::npos);
  }
  int open = 0;
  for (const auto& entry : fs::directory_iterator(fmt::format("/proc/{}/fd", process))) {
    ++open;
    const std::string to = fs::read_symlink(entry.path()).string();
    EXPECT_TRUE(to == "/dev/null" || to.starts_with("socket:")) << to;
  }
  EXPECT_EQ(open, 4);
  EXPECT_NE(::getpgid(process), ::getpgid(0));
}

TEST(Reader, SaysItsPlaceInTheFile) {
  const TemporaryFolder folder;
  test::Hdf5Writer(folder / "a.h5").numbers("x", {2}, {1, 2});
  const Hdf5File file(folder / "a.h5");
  EXPECT_EQ(file.numbers("x", {2}), (std::vector<double>{1, 2}));
  expect_error(Status::format, {folder / "a.h5: y: is not there"}, [&] { file.shape("y"); });
  EXPECT_EQ(file.shape("x"), std::vector<long>{2}) << "and goes on";
}

// Filters that this HDF5 cannot decode: here one that permutes bits, under the number of h5py's LZF.
TEST(Reader, NamesCompressionThatIsNotRead) {
  const H5Z_class2_t turn = {
      H5Z_CLASS_T_VERS,
      32000,
      1,
      1,
      "lzf",
      nullptr,
      nullptr,
      [](unsigned, std::size_t, const unsigned*, std::size_t bytes, std::size_t*, void** buffer) {
        auto* at = static_cast<unsigned char*>(*buffer);
        for (std::size_t i = 0; i < bytes; ++i) at[i] = static_cast<unsigned char>(~at[i]);
        return bytes;
      }};
  ASSERT_GE(H5Zregister(&turn), 0);
  const TemporaryFolder folder;
  {
    const hsize_t size = 4;
    const double values[4] = {1, 2, 3, 4};
    const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE), space = H5Screate_simple(1, &size, nullptr);
    H5Pset_chunk(creation, 1, &size);
    ASSERT_GE(H5Pset_filter(creation, 32000, H5Z_FLAG_MANDATORY, 0, nullptr), 0);
    const hid_t data = H5Dcreate2(file, "x", H5T_IEEE_F64LE, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    ASSERT_GE(H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
    H5Dclose(data), H5Sclose(space), H5Pclose(creation), H5Fclose(file);
  }
  H5Zunregister(32000);
  const Hdf5File file(folder / "a.h5");
  expect_error(Status::format, {folder / "a.h5: x", "LZF", "32000", "gzip"}, [&] { file.numbers("x", {4}); });
  put_file(folder / "b.h5", "version https://git-lfs.github.com/spec/v1\n");
  expect_error(Status::format, {folder / "b.h5", "Git LFS", "git lfs pull"}, [&] { Hdf5File(folder / "b.h5"); });
}

TEST(Reader, IsKilled) {
  const TemporaryFolder folder;
  test::Hdf5Writer(folder / "a.h5").numbers("x", {2}, {1, 2});
  Reader reader(folder / "a.h5", Kind::hdf5, "its file");
  reader.ask(Kind::hdf5, Packer().text(folder / "a.h5"));
  EXPECT_EQ(reader.next(0).kind, Kind::done);
  ASSERT_EQ(::kill(reader.process(), SIGKILL), 0);
  const auto again = [&] {
    reader.ask(Kind::links, Packer().text("/"));
    reader.next(1000);
  };
  expect_error(Status::format, {folder / "a.h5", "crashed", "signal 9"}, again);
  EXPECT_TRUE(reader.ended());
  expect_error(Status::format, {folder / "a.h5", "crashed", "signal 9"}, again);
}

TEST(Reader, IsMissingOrAnother) {
  const TemporaryFolder folder;
  put_file(folder / "a.obj", triangle);
  const auto load = [&] { load_mesh(folder / "a.obj"); };
  {
    const Instead none(folder / "none/vsplat-read");
    expect_error(Status::internal, {folder / "none/vsplat-read", "installed beside the library"}, load);
  }
  {
    const Instead another(script(folder, "", "old"));
    expect_error(Status::internal, {"another version", "old", read::version()}, load);
  }
  for (const auto& [body, word] :
       {std::pair{"exit 127", "ends as soon"}, std::pair{"echo hello, hello, hello >&3", "no sense"}}) {
    put_file(folder / "bad.sh", fmt::format("#!/bin/sh\n{}\n", body));
    EXPECT_EQ(::chmod((folder / "bad.sh").c_str(), 0700), 0);
    const Instead bad(folder / "bad.sh");
    expect_error(Status::internal, {folder / "bad.sh", word}, load);
  }
  EXPECT_EQ(load_mesh(folder / "a.obj").triangles(), 1u);
}

TEST(Reader, CrashesHangsOrTalksNonsense) {
  const TemporaryFolder folder;
  put_file(folder / "a.obj", triangle);
  const auto load = [&] { load_mesh(folder / "a.obj"); };
  const auto becomes = [&](const std::string& body, const std::vector<std::string>& words) {
    SCOPED_TRACE(body);
    const Instead another(script(folder, body));
    std::vector<std::string> all = words;
    all.push_back(folder / "a.obj");
    expect_error(Status::format, all, load);
  };
  becomes("kill -SEGV $$", {"crashed", "signal 11"});
  becomes("kill -ABRT $$", {"crashed", "signal 6"});
  becomes("exit 3", {"without an answer"});
  becomes("echo hello, here is a mesh of yours >&3\nexec sleep 9", {"makes no sense"});
}

TEST(Reader, TakesTooLong) {
  const TemporaryFolder folder;
  put_file(folder / "a.obj", triangle);
  const Instead silent([](Channel&) {});
  ReaderLimits limits;
  limits.seconds = 0.1;
  set_reader_limits(limits);
  expect_error(Status::format, {folder / "a.obj", "was not read within 1 seconds"},
               [&] { load_mesh(folder / "a.obj"); });
}

TEST(Reader, NeedsTooMuchMemory) {
  if (read::sanitized) GTEST_SKIP() << "a sanitizer's own memory has no limit, and the reader gives itself none there";
  const TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 20'000; ++i) text += fmt::format("v {} {} 0\n", i % 141, i / 141);
  for (int i = 0; i < 20'000; ++i)
    text += fmt::format("f {} {} {}\n", i + 1, (i + 1) % 20'000 + 1, (i + 150) % 20'000 + 1);
  put_file(folder / "a.obj", text);
  ReaderLimits limits;
  limits.memory = std::uint64_t{44} << 20, limits.memory_per_byte = 0;
  const Instead small(VSPLAT_READER);
  set_reader_limits(limits);
  expect_error(Status::format, {folder / "a.obj", "memory"}, [&] { load_mesh(folder / "a.obj"); });
}

// The reader's messages about a mesh, from the materials on.
struct Words {
  std::uint32_t material = 0, materials = 1;
  MeshCorner corner = {{1, 2, 3}};
  std::size_t corners = 3, cut = 0;  // missing bytes of the last corner
  bool part = true;

  void say(Channel& to) const {
    Packer palette;
    palette.put(materials);
    for (std::uint32_t i = 0; i < materials; ++i) pack(read::MeshMaterial(), palette);
    to.send(Kind::materials, palette);
    Packer head, body;
    pack(read::MeshPart{"part", material, false}, head);
    if (part) to.send(Kind::part, head);
    for (std::size_t i = 0; i < corners; ++i) body.raw(&corner, sizeof corner - (i + 1 == corners ? cut : 0));
    to.send(Kind::corners, body);
    to.send(Kind::done, {});
  }
};

TEST(Reader, IsNotBelieved) {
  const TemporaryFolder folder;
  put_file(folder / "a.obj", triangle);
  const auto loaded = [&](const std::function<void(Channel&)>& speak) {
    const Instead other(speak);
    return load_mesh(folder / "a.obj").triangles();
  };
  const auto refused = [&](const std::function<void(Channel&)>& speak) {
    expect_error(Status::format, {folder / "a.obj", "makes no sense"}, [&] { loaded(speak); });
  };
  const auto says = [](const Words& words) { return [words](Channel& to) { words.say(to); }; };
  EXPECT_EQ(loaded(says({})), 1u);
  refused(says({.material = 1}));
  refused(says({.part = false}));
  refused(says({.corners = 4}));
  refused(says({.cut = 1}));
  refused(says({.corner = {{NAN, 0, 0}}}));
  refused(says({.corner = {{0, 0, 0}, {0, INFINITY, 0}}}));
  refused(says({.materials = 0}));
  refused([](Channel& to) { to.send(Kind::materials, Packer().put(std::uint32_t{4'000'000'000})); });
  refused([](Channel& to) { to.send(Kind::materials, Packer().put(std::uint32_t{0}).put(std::uint32_t{0})); });
  refused([](Channel& to) { to.send(Kind::listed, {}); });
  refused([](Channel& to) { to.send(Kind::open, Packer().put(std::uint64_t{1} << 40)); });
  refused([](Channel&) {
    const read::Header large{read::magic, Kind::corners, std::uint64_t{1} << 40};
    EXPECT_EQ(::write(Instead::end, &large, sizeof large), static_cast<ssize_t>(sizeof large));
  });
  refused([](Channel& to) { to.send(Kind::failed, Packer().put(std::uint32_t{4})); });
  expect_error(Status::format, {folder / "a.obj: at: a ? b"}, [&] {
    loaded([](Channel& to) { to.send(Kind::failed, Packer().put(std::uint32_t{1}).text("at").text("a \033 b")); });
  });
  expect_error(Status::file, {"/etc/passwd", "outside"}, [&] {
    loaded([&](Channel& to) {
      to.send(Kind::open, Packer().text("/etc/passwd"));
      Words().say(to);
    });
  });
}

TEST(Reader, IsNotBelievedOfHdf5) {
  const TemporaryFolder folder;
  put_file(folder / "a.h5", "whatever");
  const auto with = [&](const std::function<void(Channel&)>& speak, const std::function<void(const Hdf5File&)>& ask) {
    const Instead other([&](Channel& to) {
      to.send(Kind::done, {});
      speak(to);
    });
    ask(Hdf5File(folder / "a.h5"));
  };
  const auto refused = [&](const std::function<void(Channel&)>& speak,
                           const std::function<void(const Hdf5File&)>& ask) {
    expect_error(Status::format, {folder / "a.h5", "makes no sense"}, [&] { with(speak, ask); });
  };
  const std::vector<double> two{1, 2};
  with([&](Channel& to) { to.send(Kind::values, Packer().raw(two.data(), 16)); },
       [&](const Hdf5File& file) { EXPECT_EQ(file.numbers("x", {2}), two); });
  refused([&](Channel& to) { to.send(Kind::values, Packer().raw(two.data(), 15)); },
          [&](const Hdf5File& file) { file.numbers("x", {2}); });
  refused([&](Channel& to) { to.send(Kind::values, Packer(std::vector<char>(17))); },
          [&](const Hdf5File& file) { file.numbers("x", {2}); });
  refused([&](Channel& to) { to.send(Kind::values, Packer().put(std::uint32_t{9})); },
          [&](const Hdf5File& file) { file.shape("x"); });
  refused([&](Channel& to) { to.send(Kind::values, Packer().shape({-1})); },
          [&](const Hdf5File& file) { file.shape("x"); });
  refused([&](Channel& to) { to.send(Kind::listed, Packer().put(std::uint32_t{1}).text("a")); },
          [&](const Hdf5File& file) { file.links("/"); });
  refused([&](Channel& to) { to.send(Kind::done, {}); }, [&](const Hdf5File& file) { file.links("/"); });
}

TEST(ReaderMeshFile, IsOfAFormatThatIsPromised) {
  const TemporaryFolder folder;
  for (const char* name : {"a.off", "a.3mf", "a.md5mesh", "a.ase", "a"}) {
    put_file(folder / name, triangle);
    expect_error(Status::input, {folder / name, ".obj, .ply, .stl, .gltf and .glb"}, [&] { load_mesh(folder / name); });
  }
  put_file(folder / "a.ply", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");  // the content would reveal its kind
  expect_error(Status::format, {folder / "a.ply", "cannot be read"}, [&] { load_mesh(folder / "a.ply"); });
  put_file(folder / "A.OBJ", triangle);
  EXPECT_EQ(load_mesh(folder / "A.OBJ").triangles(), 1u);
  put_file(folder / "a.stl",
           "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
           "0\nendloop\nendfacet\nendsolid a\n");
  EXPECT_EQ(load_mesh(folder / "a.stl").triangles(), 1u);
}

}  // namespace
}  // namespace vsplat
