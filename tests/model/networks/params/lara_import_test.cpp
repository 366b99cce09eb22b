// LaRa's checkpoints become models, and the architectures of models are distinguished.
#include <gtest/gtest.h>

#include <algorithm>

#include "model/networks/params/import.h"
#include "model/networks/params/init.h"
#include "model/networks/params/params.h"
#include "tests/support/lara_golden.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/weights.h"

namespace vsplat {
namespace {

using test::expect_equal;
using test::expect_error;
using test::LaraGolden;
using test::TemporaryFolder;

TEST(LaraImport, ACheckpointOfANamedSizeIsItsModel) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const ImportedModel got = import_model(LaraGolden::checkpoint_of("lara_micro"));
  EXPECT_EQ(got.named, "micro");
  EXPECT_EQ(system_of(got.model), "lara");
  const LaraModelFile& model = std::get<LaraModelFile>(got.model);
  EXPECT_EQ(model.config, golden.config());
  expect_equal(model.weights, golden.weights());
  // Unused buffers, and what Lightning writes beside the weights.
  for (const char* name : {"net.dense_grid", "net.centers", "net.volume_grid", "net.group_centers", "optimizer_states"})
    EXPECT_EQ(std::count(got.left_out.begin(), got.left_out.end(), name), 1) << name;

  const TemporaryFolder folder;
  save_model(folder / "lara.safetensors", model.config, model.weights, {{"origin", "a test"}});
  const AnyModel read = load_any_model(SafetensorsFile(folder / "lara.safetensors"));
  EXPECT_EQ(std::get<LaraModelFile>(read).config, model.config);
  expect_equal(std::get<LaraModelFile>(read).weights, model.weights);
  const ModelInfo info = model_info(folder / "lara.safetensors");
  EXPECT_EQ(info.system, "lara");
  EXPECT_EQ(info.config, to_json(model.config));
  EXPECT_EQ(info.parameters, parameter_count(model.config));
  EXPECT_EQ(info.provenance, (std::map<std::string, std::string>{{"origin", "a test"}}));
  EXPECT_EQ(verify_model(folder / "lara.safetensors"), HashState::matches);
  expect_error(Status::format, {"lara.safetensors", "LaRa's network", "VS-Splat's network is expected"},
               [&] { load_model(folder / "lara.safetensors"); });
}

TEST(LaraImport, WhatShapesDoNotTellIsAskedFor) {
  VSPLAT_NEED_LARA_GOLDEN("lara_micro_gaussian");
  const std::string path = LaraGolden::checkpoint_of("lara_micro_gaussian");
  // With the buffer that shows its size, feature_volume is known; GenDen's files have that buffer, too.
  expect_error(Status::usage, {"vit_heads, heads, fine_heads, windows, image, offset_cells: give each"},
               [&] { import_model(path); });
  ImportOptions options;
  options.fields = {"vit_heads=2", "heads=2", "fine_heads=3", "windows=2,1", "image=12", "offset_cells=3", "views=2"};
  for (std::size_t left = 0; left + 1 < options.fields.size(); ++left) {
    ImportOptions fewer;
    for (std::size_t i = 0; i < options.fields.size(); ++i)
      if (i != left) fewer.fields.push_back(options.fields[i]);
    const std::string field = options.fields[left].substr(0, options.fields[left].find('='));
    expect_error(Status::usage, {"do not determine " + field + ":"}, [&] { import_model(path, fewer); });
  }
  const ImportedModel got = import_model(path, options);
  EXPECT_EQ(got.named, "");
  EXPECT_EQ(std::get<LaraModelFile>(got.model).config, LaraGolden::load("lara_micro_gaussian").config());
}

TEST(LaraImport, WhatContradictsTheShapesIsRefused) {
  const std::string path = LaraGolden::checkpoint_of("lara_micro");
  ImportOptions options;
  options.fields = {"view_slots=4"};
  expect_error(Status::usage, {"determine view_slots, which is 3, but 4 was asked for"},
               [&] { import_model(path, options); });
  options.fields = {"groups=2"};
  expect_error(Status::usage, {"no field \"groups\""}, [&] { import_model(path, options); });
  options.fields = {"heads=3"};
  expect_error(Status::usage, {"lara_micro.ckpt", "volume_ch must be a multiple of heads"},
               [&] { import_model(path, options); });
  options.fields = {"revision=current"};
  EXPECT_EQ(std::get<LaraModelFile>(import_model(path, options).model).config.revision, "current");
}

// A file without the field is VS-Splat's, since files had no such field before there were other architectures.
TEST(Systems, AreToldByTheFile) {
  const TemporaryFolder folder;
  const Config config = named_config("micro");
  const Weights weights = initial_weights(config, 1);
  save_model(folder / "old.safetensors", config, weights);
  const SafetensorsFile old(folder / "old.safetensors");
  EXPECT_EQ(old.metadata().count("system"), 0U);
  EXPECT_EQ(system_of(load_any_model(old)), "vsplat");
  expect_equal(std::get<ModelFile>(load_any_model(old)).weights, weights);

  std::vector<TensorToWrite> tensors;
  for (const Parameter& p : parameters(config))
    tensors.push_back({p.name, Dtype::f32, p.shape, weights.at(p.name).data.data()});
  std::map<std::string, std::string> metadata = {
      {"format", "vsplat-model"}, {"version", "1"}, {"config", to_json(config)}};
  const auto with = [&](const std::string& system) {
    metadata["system"] = system;
    write_safetensors(folder / "named.safetensors", tensors, metadata, false);
    return SafetensorsFile(folder / "named.safetensors");
  };
  EXPECT_EQ(system_of(load_any_model(with("vsplat"))), "vsplat");
  expect_error(Status::format, {"named.safetensors", "\"splatter\"", "vsplat, lara"},
               [&] { load_any_model(with("splatter")); });
  expect_error(Status::format, {"named.safetensors", "unknown fields", "volume_mult"},
               [&] { load_any_model(with("lara")); });
  EXPECT_THROW(save_model(folder / "no.safetensors", config, weights, {{"system", "mine"}}), Error);
}

}  // namespace
}  // namespace vsplat
