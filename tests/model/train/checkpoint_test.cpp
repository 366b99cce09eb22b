#include "model/train/checkpoint.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>

#include "model/networks/params/init.h"
#include "model/networks/params/model_file.h"
#include "model/networks/params/params.h"
#include "runtime/files/safetensors.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/weights.h"

namespace vsplat {
namespace {

using test::contents_of;
using test::expect_equal;
using test::put_file;
using test::refusal;
using test::TemporaryFolder;
using test::Warnings;

void expect_equal(const Checkpoint& a, const Checkpoint& b) {
  EXPECT_EQ(a.config, b.config);
  EXPECT_EQ(a.step, b.step);
  EXPECT_EQ(a.state, b.state);
  expect_equal(a.parameters, b.parameters);
  expect_equal(a.m, b.m);
  expect_equal(a.v, b.v);
  expect_equal(a.momentum, b.momentum);
  expect_equal(a.average, b.average);
}

// Moments of every trained parameter except the refinement's, as for a configuration that does not use it.
Checkpoint sample(long step, double ema = 0.99) {
  Checkpoint c;
  c.config.model = named_config("micro");
  c.config.ema = ema;
  c.config.seed = 7;
  c.step = step;
  const auto seed = static_cast<std::uint64_t>(step);
  c.parameters = initial_weights(c.config.model, seed + 1);
  const Weights m = initial_weights(c.config.model, seed + 2), v = initial_weights(c.config.model, seed + 3);
  for (const Parameter& p : parameters(c.config.model)) {
    if (!p.trained || p.name.starts_with("voxel_network.")) continue;
    c.m.set(p.name, m.at(p.name));
    c.v.set(p.name, v.at(p.name));
  }
  if (ema != 0) c.average = initial_weights(c.config.model, seed + 4);
  c.state = {{"rng", "12345"}, {"best", "step 3\n\"21 dB\""}};
  return c;
}

TEST(Checkpoint, ComesBackToTheBit) {
  const TemporaryFolder folder;
  for (const double ema : {0.0, 0.99}) {
    Checkpoint c = sample(1200, ema);
    c.momentum.set("voxel_network.conv_in.weight", c.parameters.at("voxel_network.conv_in.weight"));
    const std::string path = checkpoint_path(folder.string(), c.step);
    EXPECT_EQ(path, folder / "checkpoint-00001200.safetensors");
    save_checkpoint(path, c);
    expect_equal(load_checkpoint(path), c);
    // Equal states give equal files.
    const std::string first = contents_of(path);
    save_checkpoint(path, load_checkpoint(path));
    EXPECT_TRUE(first == contents_of(path));
  }
  EXPECT_EQ(folder.entries().size(), 1u);
}

TEST(Checkpoint, KeepsValuesThatAreNoNumbers) {
  const TemporaryFolder folder;
  Checkpoint c = sample(3);
  HostTensor odd = c.m.at("encoder.model.norm.bias");
  odd.data[0] = std::numeric_limits<float>::quiet_NaN();
  odd.data[1] = -0.0f;
  odd.data[2] = std::numeric_limits<float>::denorm_min();
  c.m.set("encoder.model.norm.bias", odd);
  save_checkpoint(folder / "x.safetensors", c);
  expect_equal(load_checkpoint(folder / "x.safetensors"), c);
}

TEST(Checkpoint, RefusesToWriteWhatIsNotAWholeState) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.safetensors";
  Checkpoint c = sample(3);
  c.average = Weights();
  refusal([&] { save_checkpoint(path, c); }, Status::format);
  c = sample(3);
  c.m.set("of.no.model", {{1}, {1}});
  EXPECT_NE(refusal([&] { save_checkpoint(path, c); }, Status::internal).find("adamw.m."), std::string::npos);
  c = sample(3);
  c.v.set("encoder.model.norm.bias", {{1}, {1}});
  EXPECT_NE(refusal([&] { save_checkpoint(path, c); }, Status::internal).find("adamw.v.encoder.model.norm.bias"),
            std::string::npos);
  EXPECT_TRUE(folder.entries().empty());
}

// Damage is detected anywhere: at each of many positions, a byte is changed or the file ends.
TEST(Checkpoint, SeesDamage) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.safetensors";
  save_checkpoint(path, sample(3, 0));
  const std::string whole = contents_of(path);
  for (std::size_t at = 0; at < whole.size(); at += whole.size() / 97) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    put_file(path, damaged);
    EXPECT_TRUE(refusal([&] { load_checkpoint(path); }, Status::format).starts_with(path)) << "at byte " << at;
    put_file(path, whole.substr(0, at));
    EXPECT_TRUE(refusal([&] { load_checkpoint(path); }, Status::format).starts_with(path)) << "ends at " << at;
  }
}

TEST(Checkpoint, IsNoModelAndTheRefusalTellsWhereThatIs) {
  const TemporaryFolder folder;
  const std::string path = folder / "checkpoint-00000003.safetensors";
  save_checkpoint(path, sample(3));
  EXPECT_EQ(refusal([&] { load_model(path); }, Status::format),
            path +
                ": metadata format is \"vsplat-checkpoint\", expected \"vsplat-model\": this is a training's state; "
                "the weights are in model.safetensors beside it");
}

TEST(Checkpoint, RefusesOtherFilesByWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string path = folder / "x.safetensors";
  const Checkpoint c = sample(3);
  save_model(path, c);
  EXPECT_NE(refusal([&] { load_checkpoint(path); }, Status::format).find("expected \"vsplat-checkpoint\""),
            std::string::npos);

  // Written with a hash that fits, so that only the content is wrong.
  std::vector<TensorToWrite> tensors;
  std::map<std::string, std::string> metadata;
  const auto rebuild = [&] {
    tensors.clear();
    for (const auto& [name, t] : c.parameters.all()) tensors.push_back({name, Dtype::f32, t.shape, t.data.data()});
    for (const auto& [name, t] : c.average.all())
      tensors.push_back({"average." + name, Dtype::f32, t.shape, t.data.data()});
    metadata = {{"format", "vsplat-checkpoint"}, {"version", "1"}, {"step", "3"}, {"config", to_json(c.config)}};
  };
  const auto expect_refused = [&](const std::string& words) {
    write_safetensors(path, tensors, metadata, true);
    const std::string text = refusal([&] { load_checkpoint(path); }, Status::format);
    EXPECT_NE(text.find(words), std::string::npos) << text << "\nexpected " << words;
    rebuild();
  };
  rebuild();
  write_safetensors(path, tensors, metadata, true);
  EXPECT_EQ(load_checkpoint(path).m.all().size(), 0u);  // before the first step
  metadata["version"] = "2";
  expect_refused("version is \"2\", expected \"1\"");
  metadata["step"] = "-3";
  expect_refused("step is \"-3\"");
  metadata["step"] = "3.5";
  expect_refused("step is \"3.5\"");
  metadata.erase("config");
  expect_refused("no config");
  metadata["config"] = R"({"model": "micro", "steps": 0})";
  expect_refused("steps must be");
  metadata["config"] = R"({"model": "tiny", "ema": 0.5})";
  expect_refused("expected [");
  tensors.pop_back();
  expect_refused("1 of ");
  tensors.push_back({"something", Dtype::f32, {1}, c.parameters.all().begin()->second.data.data()});
  expect_refused("of which this configuration has");
  tensors.push_back({"adamw.m.encoder.model.norm.bias", Dtype::f32, {1}, tensors[0].data});
  expect_refused("adamw.m.encoder.model.norm.bias is F32 [1], expected F32 [12]");
  tensors.push_back({"adamw.v.encoder.model.norm.bias", Dtype::f32, {12}, tensors[0].data});
  expect_refused("no tensor adamw.m.encoder.model.norm.bias");

  write_safetensors(path, tensors, metadata, false);
  EXPECT_NE(refusal([&] { load_checkpoint(path); }, Status::format).find("no sha256"), std::string::npos);
}

TEST(Checkpoint, TheNewestGoodOneIsFound) {
  const TemporaryFolder folder;
  EXPECT_FALSE(newest_checkpoint(folder.string()));
  put_file(folder / "checkpoint-.safetensors", "not one of ours");
  put_file(folder / "checkpoint-x1.safetensors", "neither");
  EXPECT_FALSE(newest_checkpoint(folder.string()));
  for (const long step : {900L, 1000L, 123456789L})
    save_checkpoint(checkpoint_path(folder.string(), step), sample(step));
  {
    const Warnings warnings;
    expect_equal(*newest_checkpoint(folder.string()), sample(123456789));
    EXPECT_TRUE(warnings.all.empty());
  }
  const std::string newest = checkpoint_path(folder.string(), 123456789);
  put_file(newest, contents_of(newest).substr(0, 5000));
  {
    const Warnings warnings;
    expect_equal(*newest_checkpoint(folder.string()), sample(1000));
    ASSERT_EQ(warnings.all.size(), 1u);
    EXPECT_NE(warnings.all[0].find(newest), std::string::npos);
  }
  for (const long step : {900L, 1000L}) put_file(checkpoint_path(folder.string(), step), "");
  const Warnings warnings;
  EXPECT_NE(refusal([&] { newest_checkpoint(folder.string()); }, Status::format).find("none of its 3"),
            std::string::npos);
  EXPECT_EQ(warnings.all.size(), 3u);
  refusal([&] { newest_checkpoint(folder / "none"); }, Status::file);
}

TEST(Checkpoint, OldOnesAndUnfinishedOnesAreRemoved) {
  const TemporaryFolder folder;
  for (const long step : {5L, 10L, 99999999L, 100000000L})
    put_file(checkpoint_path(folder.string(), step), "content does not matter");
  put_file(checkpoint_path(folder.string(), 7) + ".4711-0.tmp", "of a run that was killed");
  put_file(folder / "log.csv", "stays");
  prune_checkpoints(folder.string(), 2);
  EXPECT_EQ(folder.entries(), (std::vector<std::string>{"checkpoint-100000000.safetensors",
                                                        "checkpoint-99999999.safetensors", "log.csv"}));
  prune_checkpoints(folder.string(), 2);
  EXPECT_EQ(folder.entries().size(), 3u);
}

TEST(Checkpoint, GivesTheModelForInference) {
  const TemporaryFolder folder;
  const std::string path = folder / "model.safetensors";
  const Checkpoint averaged = sample(42), plain = sample(42, 0);
  save_model(path, averaged, {{"data set", "solids"}});
  const ModelFile file = load_model(path);
  expect_equal(file.weights, averaged.average);
  EXPECT_EQ(file.config, averaged.config.model);
  EXPECT_EQ(file.metadata.at("step"), "42");
  EXPECT_EQ(file.metadata.at("seed"), "7");
  EXPECT_EQ(file.metadata.at("data set"), "solids");
  EXPECT_EQ(train_config_from_json(file.metadata.at("training")), averaged.config);
  save_model(path, plain);
  expect_equal(load_model(path).weights, plain.parameters);
}

// Makes writes end halfway: limits the size of files while this lives.
class SmallFiles {
 public:
  explicit SmallFiles(rlim_t most) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit small = {most, before_.rlim_max};
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    ::setrlimit(RLIMIT_FSIZE, &small);
  }
  ~SmallFiles() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_ = {};
  void (*handler_)(int) = nullptr;
};

TEST(Checkpoint, AWriteThatFailsLosesNothing) {
  const TemporaryFolder folder;
  const std::string path = checkpoint_path(folder.string(), 100), next = checkpoint_path(folder.string(), 200);
  save_checkpoint(path, sample(100));
  const std::string before = contents_of(path);
  {
    const SmallFiles limit(before.size() / 2);
    for (const std::string& target : {path, next}) {
      const std::string text = refusal([&] { save_checkpoint(target, sample(200)); }, Status::file);
      EXPECT_TRUE(text.starts_with(target + ": cannot be written: File too large")) << text;
    }
  }
  EXPECT_EQ(folder.entries(), std::vector<std::string>{"checkpoint-00000100.safetensors"});
  EXPECT_TRUE(contents_of(path) == before);
  expect_equal(*newest_checkpoint(folder.string()), sample(100));

  // A folder that is a file, one that does not exist, and one without write permission.
  put_file(folder / "file", "");
  for (const std::string& unwritable : {folder / "file", folder / "none", std::string("/proc")}) {
    const std::string target = checkpoint_path(unwritable, 1);
    EXPECT_TRUE(refusal([&] { save_checkpoint(target, sample(1)); }, Status::file).starts_with(target)) << unwritable;
  }
}

// In a child process: a file system slightly larger than one checkpoint, which the second one does not fit into. Exit
// code: 77 if this system does not permit mounting, else 0 or the number of the check that failed.
int fill_a_disk(const std::string& folder) {
  const auto identity = [](const char* path, const std::string& text) {
    const int file = ::open(path, O_WRONLY | O_CLOEXEC);
    if (file >= 0 && ::write(file, text.data(), text.size()) >= 0) ::close(file);
  };
  const unsigned user = ::getuid(), group = ::getgid();
  if (::unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return 77;
  identity("/proc/self/setgroups", "deny");
  identity("/proc/self/uid_map", fmt::format("0 {} 1", user));
  identity("/proc/self/gid_map", fmt::format("0 {} 1", group));
  const Checkpoint first = sample(100), second = sample(200);
  save_checkpoint(folder + "/probe", first);
  const std::size_t size = contents_of(folder + "/probe").size();
  const std::string options = fmt::format("size={}", size + size / 2);
  if (::mount("none", folder.c_str(), "tmpfs", 0, options.c_str()) != 0) return 77;
  save_checkpoint(checkpoint_path(folder, 100), first);
  const std::string target = checkpoint_path(folder, 200);
  try {
    save_checkpoint(target, second);
    return 1;
  } catch (const Error& e) {
    if (e.status() != Status::file) return 2;
    if (e.what() != target + ": cannot be written: No space left on device") return 3;
  }
  const std::optional<Checkpoint> newest = newest_checkpoint(folder);
  if (!newest || newest->step != 100) return 4;
  if (std::distance(std::filesystem::directory_iterator(folder), {}) != 1) return 5;
  return 0;
}

TEST(Checkpoint, AFullDiskLosesNothing) {
  const TemporaryFolder folder;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    int code = 99;
    try {
      code = fill_a_disk(folder.string());
    } catch (...) {
    }
    ::_exit(code);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == 77) GTEST_SKIP() << "this system lets nobody mount a file system";
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace vsplat
