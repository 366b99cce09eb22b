#include "model/networks/params/model_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <random>

#include "model/networks/params/params.h"
#include "runtime/half.h"
#include "tests/support/golden.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/weights.h"

namespace vsplat {
namespace {

using test::contents_of;
using test::expect_equal;
using test::Golden;
using test::put_file;
using test::TemporaryFolder;

class ModelFileTest : public ::testing::Test {
 protected:
  // A model's tensors as they would be written, for tests that damage them.
  struct Draft {
    std::vector<TensorToWrite> tensors;
    std::map<std::string, std::string> metadata;
    TensorToWrite& at(const std::string& name) {
      for (TensorToWrite& t : tensors)
        if (t.name == name) return t;
      throw std::runtime_error(name);
    }
  };

  Draft draft() const {
    Draft out;
    for (const Parameter& p : parameters(golden_.config()))
      out.tensors.push_back({p.name, Dtype::f32, p.shape, golden_.weights().at(p.name).data.data()});
    out.metadata = {{"format", "vsplat-model"}, {"version", "1"}, {"config", to_json(golden_.config())}};
    return out;
  }

  std::string written(const Draft& d, bool hash = false) const {
    const std::string path = folder_.path("draft.safetensors");
    write_safetensors(path, d.tensors, d.metadata, hash);
    return path;
  }

  std::string saved() const {
    const std::string path = folder_.path("model.safetensors");
    save_model(path, golden_.config(), golden_.weights(), {{"seed", "0"}, {"data set", "none"}});
    return path;
  }

  std::string refusal(const Draft& d) const {
    const std::string path = written(d);
    std::string message;
    for (const auto& reader :
         {std::function<void()>([&] { load_model(path); }), std::function<void()>([&] { model_info(path); })}) {
      message = test::refusal(reader, Status::format);
      EXPECT_NE(message.find(path), std::string::npos) << message;
    }
    return message;
  }

  TemporaryFolder folder_;
  Golden golden_ = Golden::load("micro");
};

TEST_F(ModelFileTest, ReturnsWhatWasSaved) {
  const ModelFile model = load_model(saved());
  EXPECT_EQ(model.config, golden_.config());
  expect_equal(model.weights, golden_.weights());
  EXPECT_EQ(model.metadata.at("seed"), "0");
  EXPECT_EQ(verify_model(saved()), HashState::matches);
}

TEST_F(ModelFileTest, InfoTellsWhatTheHeaderSays) {
  const std::string path = saved();
  const ModelInfo info = model_info(path);
  EXPECT_EQ(info.config, to_json(golden_.config()));
  EXPECT_EQ(info.parameters, 38551);
  EXPECT_EQ(info.tensors, parameters(golden_.config()).size());
  EXPECT_EQ(info.dtypes, (std::map<std::string, std::size_t>{{"F32", info.tensors}}));
  EXPECT_EQ(info.sha256.size(), 64u);
  EXPECT_EQ(info.provenance, (std::map<std::string, std::string>{{"seed", "0"}, {"data set", "none"}}));
  EXPECT_EQ(info.file_bytes, contents_of(path).size());
}

TEST_F(ModelFileTest, SavingAgainGivesTheSameBytes) {
  const std::string first = contents_of(saved());
  EXPECT_EQ(contents_of(saved()), first);
}

TEST_F(ModelFileTest, AcceptsFilesOfTheReference) {
  // No hash, the tensors in another order, and Lightning's prefix; in half precision, too.
  Draft d = draft();
  std::reverse(d.tensors.begin(), d.tensors.end());
  for (TensorToWrite& t : d.tensors) t.name = "net." + t.name;
  const std::string path = written(d);
  expect_equal(load_model(path).weights, golden_.weights());
  EXPECT_EQ(verify_model(path), HashState::absent);

  std::vector<std::vector<std::uint16_t>> halves;
  Weights rounded;
  for (TensorToWrite& t : d.tensors) {
    const std::string name = t.name.substr(4);
    HostTensor tensor = golden_.weights().at(name);
    auto& stored = halves.emplace_back();
    for (float& v : tensor.data) {
      stored.push_back(to_half(v));
      v = from_half(stored.back());
    }
    rounded.set(name, tensor);
    t.dtype = Dtype::f16;
    t.data = stored.data();
  }
  expect_equal(load_model(written(d)).weights, rounded);
  EXPECT_EQ(model_info(written(d)).dtypes, (std::map<std::string, std::size_t>{{"F16", d.tensors.size()}}));
}

TEST_F(ModelFileTest, ReadsHalvesAndBrainFloats) {
  Draft d = draft();
  std::vector<std::vector<std::uint16_t>> stored;
  for (TensorToWrite& t : d.tensors) {  // bfloat16: the upper half of the float
    auto& values = stored.emplace_back();
    for (const float v : golden_.weights().at(t.name).data)
      values.push_back(static_cast<std::uint16_t>(std::bit_cast<std::uint32_t>(v) >> 16));
    t.dtype = Dtype::bf16;
    t.data = values.data();
  }
  const ModelFile model = load_model(written(d, true));
  for (const auto& [name, tensor] : golden_.weights().all())
    for (std::size_t i = 0; i < tensor.data.size(); ++i)
      ASSERT_EQ(model.weights.at(name).data[i],
                std::bit_cast<float>(std::bit_cast<std::uint32_t>(tensor.data[i]) & 0xffff0000u));
}

TEST_F(ModelFileTest, NamesWhatIsMissingMisshapenOrUnexpected) {
  Draft d = draft();
  std::erase_if(d.tensors, [](const TensorToWrite& t) { return t.name == "dir_norm.mlp.2.bias"; });
  EXPECT_NE(refusal(d).find("dir_norm.mlp.2.bias"), std::string::npos);

  d = draft();
  d.at("dir_norm.mlp.0.weight").shape = {32, 12};
  EXPECT_NE(refusal(d).find("dir_norm.mlp.0.weight has shape [32, 12], expected [12, 32]"), std::string::npos);

  d = draft();
  d.at("dir_norm.mlp.0.weight").dtype = Dtype::i32;
  EXPECT_NE(refusal(d).find("dir_norm.mlp.0.weight is I32"), std::string::npos);

  d = draft();
  const float extra = 1;
  d.tensors.push_back({"surprise", Dtype::f32, {1}, &extra});
  EXPECT_NE(refusal(d).find("surprise"), std::string::npos);

  d = draft();
  d.tensors.push_back(d.at("div_offset"));
  d.tensors.back().name = "net.div_offset";
  EXPECT_NE(refusal(d).find("net.div_offset"), std::string::npos);

  d = draft();
  d.tensors.push_back({"encoder.model.head.bias", Dtype::f32, {1}, &extra});
  EXPECT_NO_THROW(load_model(written(d)));
}

TEST_F(ModelFileTest, NamesWhatIsWrongInTheMetadata) {
  for (const char* key : {"format", "version", "config"}) {
    Draft d = draft();
    d.metadata.erase(key);
    EXPECT_NE(refusal(d).find(key), std::string::npos);
    d.metadata[key] = "2";
    EXPECT_NE(refusal(d).find("2"), std::string::npos);
  }
  Draft d = draft();
  d.metadata["config"] = R"({"image": 16, "imaeg": 16})";
  EXPECT_NE(refusal(d).find("imaeg"), std::string::npos);
  d.metadata["config"] = R"({"image": 17})";
  EXPECT_NE(refusal(d).find("image must be a multiple of patch (found 17 and 16)"), std::string::npos);
  d.metadata["config"] = "{}";  // the paper's sizes, which the tensors do not have
  EXPECT_NE(refusal(d).find("shape"), std::string::npos);
}

TEST_F(ModelFileTest, SavesHalves) {
  const auto save = [&](const std::string& name, const Weights& weights) {
    save_model(folder_ / name, golden_.config(), weights, {{"seed", "0"}}, Dtype::f16);
    return folder_ / name;
  };
  const std::string path = save("half", golden_.weights());
  const ModelFile model = load_model(path);
  EXPECT_EQ(model.config, golden_.config());
  EXPECT_EQ(model.metadata.at("seed"), "0");
  for (const auto& [name, tensor] : golden_.weights().all())
    for (std::size_t i = 0; i < tensor.data.size(); ++i)
      ASSERT_EQ(model.weights.at(name).data[i], from_half(to_half(tensor.data[i]))) << name;
  const ModelInfo info = model_info(path);
  EXPECT_EQ(info.dtypes, (std::map<std::string, std::size_t>{{"F16", info.tensors}}));
  EXPECT_EQ(verify_model(path), HashState::matches);
  EXPECT_LT(contents_of(path).size(), contents_of(saved()).size());
  // Values that were rounded once are exact.
  EXPECT_EQ(contents_of(save("again", model.weights)), contents_of(path));
}

TEST_F(ModelFileTest, RefusesWhatHalvesCannotHold) {
  Weights weights = golden_.weights();
  HostTensor tensor = weights.at("div_offset");
  tensor.data[1] = -65520.0f;
  weights.set("div_offset", tensor);
  test::expect_error(Status::input, {"div_offset", "-65520", "65504", "F32"},
                     [&] { save_model(folder_.path("x"), golden_.config(), weights, {}, Dtype::f16); });
  EXPECT_THROW(save_model(folder_.path("x"), golden_.config(), golden_.weights(), {}, Dtype::bf16), Error);
  EXPECT_TRUE(folder_.entries().empty());
  tensor.data[1] = -65519.0f;
  weights.set("div_offset", tensor);
  save_model(folder_.path("x"), golden_.config(), weights, {}, Dtype::f16);
  EXPECT_EQ(load_model(folder_.path("x")).weights.at("div_offset").data[1], -65504.0f);
}

TEST_F(ModelFileTest, RefusesToSaveWhatItWouldNotLoad) {
  EXPECT_THROW(save_model(folder_.path("x"), golden_.config(), golden_.weights(), {{"config", "{}"}}), Error);
  Weights weights = golden_.weights();
  weights.set("div_offset", {{1, 3}, {0, 0, 0}});
  EXPECT_THROW(save_model(folder_.path("x"), golden_.config(), weights), Error);
  EXPECT_TRUE(folder_.entries().empty());
}

// Damage: an error or an identical result, never a crash.
class Damage : public ModelFileTest {
 protected:
  // Returns true if the content was refused.
  bool refuses(const std::string& content) {
    const std::string path = folder_.path("damaged.safetensors");
    put_file(path, content);
    try {
      const ModelFile model = load_model(path);
      EXPECT_EQ(model.config, golden_.config());
      expect_equal(model.weights, golden_.weights());
      return false;
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(path), std::string::npos) << e.what();
      return true;
    }
  }
};

TEST_F(Damage, TruncatedAnywhere) {
  const std::string whole = contents_of(saved());
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(refuses(whole.substr(0, random() % whole.size())));
  for (std::size_t n = 0; n < 100; ++n) EXPECT_TRUE(refuses(whole.substr(0, n)));
  EXPECT_TRUE(refuses(whole.substr(0, whole.size() - 1)));
  EXPECT_TRUE(refuses(whole + '\0'));
}

TEST_F(Damage, ABitFlippedAnywhere) {
  const std::string whole = contents_of(saved());
  std::uint64_t length = 0;
  std::memcpy(&length, whole.data(), 8);
  std::mt19937 random(2);
  const auto flip = [&](std::size_t bit) {
    std::string content = whole;
    content[bit / 8] = static_cast<char>(content[bit / 8] ^ 1 << bit % 8);
    return refuses(content);
  };
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(flip(random() % ((whole.size() - 8 - length) * 8) + (8 + length) * 8));
  int refused = 0;
  for (int i = 0; i < 300; ++i) refused += flip(random() % ((8 + length) * 8));
  EXPECT_GE(refused, 290);  // the rest: capitals in the digest, or another name for the hash
  for (std::size_t bit = 0; bit < 64; ++bit) EXPECT_TRUE(flip(bit));
}

TEST_F(Damage, ABitFlippedInAHeaderWithoutHash) {
  // A changed setting or a harmless word is not detected. But every tensor that is read has its own values.
  const std::string whole = contents_of(written(draft())), path = folder_.path("x");
  std::uint64_t length = 0;
  std::memcpy(&length, whole.data(), 8);
  std::mt19937 random(3);
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string content = whole;
    const std::size_t bit = random() % ((8 + length) * 8);
    content[bit / 8] = static_cast<char>(content[bit / 8] ^ 1 << bit % 8);
    put_file(path, content);
    try {
      expect_equal(load_model(path).weights, golden_.weights());
    } catch (const Error& e) {
      EXPECT_EQ(e.status(), Status::format) << e.what();
      EXPECT_NE(std::string(e.what()).find(path), std::string::npos) << e.what();
      ++refused;
    }
  }
  EXPECT_GE(refused, 290);  // the rest: settings that affect no shape
}

}  // namespace
}  // namespace vsplat
