#include "model/metrics/lpips_distance.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <map>

#include "runtime/files/safetensors.h"
#include "tests/support/device.h"
#include "tests/support/golden.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

// As numbers() in tests/reference/pytorch/make_lpips.py: [0,1).
double number(std::uint64_t seed, std::uint64_t i) {
  std::uint64_t z = (seed << 32) + i + 0x9E3779B97F4A7C15u;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  z = z ^ (z >> 31);
  return static_cast<double>(z >> 40) / 16777216.0;
}

using Tensors = std::map<std::string, std::pair<Shape, std::vector<float>>>;

void add(Tensors& out, const std::string& name, const Shape& shape, std::uint64_t seed, double low, double high) {
  long count = 1;
  for (const long n : shape) count *= n;
  std::vector<float> values(static_cast<std::size_t>(count));
  const double half = (high - low) / 2;
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<float>(low == 0 ? number(seed, i) * high : (number(seed, i) * 2 - 1) * half);
  out[name] = {shape, std::move(values)};
}

// The script's weights under torchvision's names, with extra tensors that are not needed.
Tensors weights_of(LpipsNet net) {
  struct Conv {
    int index;
    long cin, cout, side;
    bool compared;
  };
  std::vector<Conv> convs;
  if (net == LpipsNet::alex)
    convs = {{0, 3, 64, 11, true},
             {3, 64, 192, 5, true},
             {6, 192, 384, 3, true},
             {8, 384, 256, 3, true},
             {10, 256, 256, 3, true}};
  else
    convs = {{0, 3, 64, 3, false},     {2, 64, 64, 3, true},     {5, 64, 128, 3, false},   {7, 128, 128, 3, true},
             {10, 128, 256, 3, false}, {12, 256, 256, 3, false}, {14, 256, 256, 3, true},  {17, 256, 512, 3, false},
             {19, 512, 512, 3, false}, {21, 512, 512, 3, true},  {24, 512, 512, 3, false}, {26, 512, 512, 3, false},
             {28, 512, 512, 3, true}};
  Tensors out;
  std::uint64_t seed = 0, head = 0;
  for (const Conv& c : convs) {
    const double bound = std::sqrt(6.0 / static_cast<double>(c.cin * c.side * c.side));
    const std::string name = fmt::format("features.{}", c.index);
    add(out, name + ".weight", {c.cout, c.cin, c.side, c.side}, seed++, -bound, bound);
    add(out, name + ".bias", {c.cout}, seed++, -0.1, 0.1);
    if (!c.compared) continue;
    add(out, fmt::format("lin{}.model.1.weight", head), {1, c.cout, 1, 1}, 100 + head, 0, 1);
    ++head;
  }
  add(out, "classifier.1.weight", {2, 3}, 1, -1, 1);
  return out;
}

void write(const std::string& path, const Tensors& tensors) {
  std::vector<TensorToWrite> list;
  for (const auto& [name, tensor] : tensors) list.push_back({name, Dtype::f32, tensor.first, tensor.second.data()});
  write_safetensors(path, list);
}

Image picture_of(const SafetensorsFile& file, const std::string& name) {
  const TensorEntry& entry = file.at(name);
  Image out(static_cast<int>(entry.shape[1]), static_cast<int>(entry.shape[0]), 3);
  out.data = file.floats(entry);
  return out;
}

class LpipsTest : public test::FlavourTest {
 protected:
  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "weights.safetensors";
};
VSPLAT_FLAVOURS(LpipsTest);

TEST_P(LpipsTest, AgreesWithPyTorch) {
  const SafetensorsFile golden(test::Golden::path_of("lpips"));
  for (const LpipsNet net : {LpipsNet::alex, LpipsNet::vgg}) {
    write(path_, weights_of(net));
    const Lpips lpips(ctx(), path_, net);
    for (const std::string i : {"0", "1"}) {
      const Image a = picture_of(golden, i + ".a"), b = picture_of(golden, i + ".b");
      const double want = golden.floats(golden.at(i + "." + name_of(net)))[0];
      EXPECT_NEAR(lpips.distance(ctx(), a, b), want, 1e-5 * want) << name_of(net) << i;
      EXPECT_NEAR(lpips.distance(ctx(), b, a), want, 1e-5 * want) << name_of(net) << i;
      EXPECT_EQ(lpips.distance(ctx(), a, a), 0);
    }
  }
}

TEST_P(LpipsTest, RefusesSmallAndUnequalPictures) {
  write(path_, weights_of(LpipsNet::alex));
  const Lpips lpips(ctx(), path_, LpipsNet::alex);
  EXPECT_EQ(lpips.smallest(), 31);
  EXPECT_GT(lpips.distance(ctx(), Image(31, 31, 3, 0.5f), Image(31, 31, 3, 0.75f)), 0);
  for (const auto& [a, b] : {std::pair{Image(30, 64, 3), Image(30, 64, 3)},
                             {Image(64, 30, 3), Image(64, 30, 3)},
                             {Image(64, 32, 3), Image(32, 64, 3)},
                             {Image(64, 64, 4), Image(64, 64, 4)}})
    EXPECT_THROW(lpips.distance(ctx(), a, b), Error);
}

TEST(LpipsFile, NamesTheTensorThatIsWrong) {
  const TemporaryFolder folder;
  const std::string path = folder / "alex.safetensors";
  const auto refusal = [&](const Tensors& tensors) {
    write(path, tensors);
    try {
      Lpips(test::context(Flavour::cpu), path, LpipsNet::alex);
    } catch (const Error& e) {
      EXPECT_EQ(e.status(), Status::format);
      return std::string(e.what());
    }
    return std::string();
  };
  const Tensors good = weights_of(LpipsNet::alex);
  EXPECT_EQ(refusal(good), "");
  for (const std::string name : {"features.3.weight", "features.10.bias", "lin4.model.1.weight"}) {
    Tensors bad = good;
    bad.erase(name);
    EXPECT_NE(refusal(bad).find(name), std::string::npos);
    bad = good;
    bad[name].first.push_back(1);
    const std::string text = refusal(bad);
    EXPECT_TRUE(text.starts_with(path) && text.find(name) != std::string::npos) << text;
    EXPECT_NE(text.find("expected ["), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace vsplat
