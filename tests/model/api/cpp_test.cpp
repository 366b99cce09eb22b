// The C++ wrapper: lambdas, what they throw, spans, and that nothing is copied on the way.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace {

int failures = 0;

void hold_at(int line, bool good, const char* what) {
  if (good) return;
  ++failures;
  std::printf("line %d: %s does not hold\n", line, what);
}
#define HOLD(what) hold_at(__LINE__, what, #what)

using vsplat::ConstGaussianSpans;
using vsplat::Device;
using vsplat::Error;
using vsplat::Gaussians;
using vsplat::Input;
using vsplat::Job;
using vsplat::Model;
using vsplat::Picture;
using vsplat::PictureSpans;
using vsplat::Scene;
using vsplat::Span;

bool same_bits(const void* a, const void* b, size_t bytes) { return std::memcmp(a, b, bytes) == 0; }

// Returns the status of the Error that the callable throws; VSPLAT_OK if it throws none.
template <class F>
vsplat_status status_of(const F& run) {
  try {
    run();
  } catch (const Error& e) {
    return e.status();
  }
  return VSPLAT_OK;
}

struct Setting {
  Device device{VSPLAT_DEVICE_OPTIONS_INIT};
  Model model = init();
  Input input = views();
  vsplat_camera camera = in_front();
  std::array<int32_t, 3> voxels{3, 21, 40};
  vsplat_reconstruct_options options = VSPLAT_RECONSTRUCT_OPTIONS_INIT;

  Setting() {
    options.voxels = voxels.data();
    options.num_voxels = voxels.size();
  }
  static Model init() {
    vsplat_model_options options = VSPLAT_MODEL_OPTIONS_INIT;
    options.config = "micro";
    return Model::init(options);
  }
  static vsplat_camera in_front() {
    vsplat_camera out = VSPLAT_CAMERA_INIT;
    out.width = out.height = 16;
    out.fx = out.fy = 20;
    out.cx = out.cy = 8;
    out.w2c[11] = 2;
    return out;
  }
  Input views() const {
    std::array<float, 16 * 16 * 3> pixels{};
    for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<float>(i * 7919 % 101) / 101.0f;
    std::array<vsplat_view, 2> all{};
    for (size_t i = 0; i < all.size(); ++i) {
      all[i] = VSPLAT_VIEW_INIT;
      all[i].pixels = pixels.data();
      all[i].camera = in_front();
      if (i == 1) all[i].camera.w2c[0] = all[i].camera.w2c[10] = -1;
    }
    return Input(model, vsplat::Views::create(all), VSPLAT_INPUT_OPTIONS_INIT);
  }
  Scene scene() const { return vsplat::reconstruct(device, model, input, options); }
};

bool are_equal(const Gaussians& a, const Gaussians& b) {
  return !a.means.empty() && a.means == b.means && a.scales == b.scales && a.rotations == b.rotations &&
         a.opacities == b.opacities && a.sh == b.sh;
}

void lambdas_are_called_and_what_they_throw_comes_out(const Setting& with) {
  std::vector<std::string> stages;
  const Scene reporting =
      vsplat::reconstruct(with.device, with.model, with.input, with.options,
                          [&](const char* stage, double) { return stages.emplace_back(stage), true; });
  HOLD(stages.size() > 3);
  HOLD(are_equal(reporting.gaussians(), with.scene().gaussians()));
  HOLD(status_of([&] {
         vsplat::reconstruct(with.device, with.model, with.input, with.options,
                             [](const char*, double) { return false; });
       }) == VSPLAT_ERROR_CANCELLED);
  bool thrown = false;
  try {
    vsplat::reconstruct(with.device, with.model, with.input, with.options,
                        [](const char*, double) -> bool { throw std::out_of_range("enough"); });
  } catch (const std::out_of_range& e) {
    thrown = std::string(e.what()) == "enough";
  }
  HOLD(thrown);
  HOLD(are_equal(reporting.gaussians(), with.scene().gaussians()));  // and the device still works
  int prepared = 0;
  vsplat::prepare(with.device, with.model, VSPLAT_PREPARE_OPTIONS_INIT,
                  [&](const char*, double) { return ++prepared > 0; });
  HOLD(prepared > 0);
}

void messages_reach_a_lambda() {
  std::vector<std::string> messages;
  vsplat::log_to([&](vsplat_log_level, const char* text) { messages.emplace_back(text); });
  { const Device opened{VSPLAT_DEVICE_OPTIONS_INIT}; }
  Setting::init();
  const Setting loud;
  vsplat::log_to({});
  const size_t count = messages.size();
  const Setting silent;
  HOLD(count > 0);
  HOLD(messages.size() == count);
}

void spans_are_read_and_written_where_they_lie(const Setting& with) {
  const Scene scene = with.scene();
  const size_t count = scene.info().count;
  HOLD(count > 0);
  std::vector<float> means(3 * count, -1);
  scene.read({means, {}, {}, {}, {}});
  HOLD(means == scene.gaussians().means);

  const Gaussians all = scene.gaussians();
  const Scene again = Scene::create(all, scene.info().sh_degree, scene.info());
  HOLD(are_equal(again.gaussians(), all));
  std::vector<float> opacities(count, 0.5f);
  ConstGaussianSpans changed;
  changed.opacities = opacities;
  again.update(changed);
  HOLD(again.gaussians().opacities == opacities);
  HOLD(again.gaussians().means == all.means);

  std::array<float, 16 * 16> alpha{};
  vsplat::render(with.device, scene, with.camera, PictureSpans{{}, alpha, {}});
  const Picture whole = vsplat::render(with.device, scene, with.camera);
  HOLD(same_bits(alpha.data(), whole.alpha.data(), sizeof alpha));
  std::array<float, 16 * 16 - 1> small{};
  HOLD(status_of([&] {
         vsplat::render(with.device, scene, with.camera, PictureSpans{{}, small, {}});
       }) == VSPLAT_ERROR_USAGE);
  HOLD(status_of([&] { scene.read({{means.data(), means.size() - 1}, {}, {}, {}, {}}); }) == VSPLAT_ERROR_USAGE);

  std::array<vsplat_camera, 2> cameras{with.camera, with.camera};
  cameras[1].w2c[11] = 3;
  std::array<Picture, 2> pictures{Picture(16, 16), Picture(16, 16)};
  const std::array<PictureSpans, 2> into{pictures[0], pictures[1]};
  int drawn = 0;
  vsplat::render(with.device, scene, cameras, into, VSPLAT_RENDER_OPTIONS_INIT,
                 [&](const char*, double) { return ++drawn > 0; });
  HOLD(drawn > 1);
  HOLD(pictures[0].colour == whole.colour);
  HOLD(pictures[1].colour == vsplat::render(with.device, scene, cameras[1]).colour);
  HOLD(status_of([&] { vsplat::render(with.device, scene, cameras, Span<const PictureSpans>(into.data(), 1)); }) ==
       VSPLAT_ERROR_USAGE);

  Picture by_picture(16, 16);
  for (size_t i = 0; i < by_picture.colour.size(); ++i) by_picture.colour[i] = static_cast<float>(i % 7) - 3;
  const vsplat::Gradient all_of_it = vsplat::render_backward(with.device, scene, with.camera, by_picture);
  std::vector<float> by_opacity(count);
  std::array<double, 6> pose{};
  vsplat::render_backward(with.device, scene, with.camera, {by_picture.colour, {}, {}}, {{}, {}, {}, by_opacity, {}},
                          pose);
  HOLD(by_opacity == all_of_it.gaussians.opacities);
  HOLD(same_bits(pose.data(), all_of_it.pose, sizeof pose));
  HOLD(pose[5] != 0);
}

void a_profile_is_reported_in_rows(const Setting& with) {
  with.scene();
  Device stream = with.device.stream();
  stream.profile(true);
  const Scene scene = vsplat::reconstruct(stream, with.model, with.input, with.options);
  stream.profile(false);
  const std::vector<vsplat_profile_row> rows = stream.profile_rows();
  HOLD(rows.size() > 10);
  const std::string json = stream.profile_text(VSPLAT_PROFILE_JSON);
  double before = 1e9;
  bool encoder = false;
  for (const vsplat_profile_row& row : rows) {
    HOLD(row.calls > 0 && row.seconds <= before && row.least <= row.most && row.first_calls <= row.calls);
    HOLD(row.most <= row.seconds * (1 + 1e-9) && row.seconds <= row.most * static_cast<double>(row.calls) * (1 + 1e-9));
    HOLD(json.find('"' + std::string(row.kernel) + '"') != std::string::npos);
    encoder = encoder || (std::string(row.stage) == "encoder" && row.flops > 0);
    before = row.seconds;
  }
  HOLD(encoder);
  vsplat_profile_row none = VSPLAT_PROFILE_ROW_INIT;
  HOLD(vsplat_device_profile_get(stream.get(), rows.size(), &none) == VSPLAT_ERROR_USAGE);
}

void cameras_are_made(const Setting& with) {
  const vsplat_camera front = vsplat::looking_at({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 16, 16);
  HOLD(front.w2c[0] == 1 && front.w2c[5] == 1 && front.w2c[10] == 1 && front.w2c[11] == 2);
  HOLD(front.width == 16 && front.cx == 8 && front.fx > 17.1 && front.fx < 17.2);
  const vsplat_camera side = vsplat::looking_at({2, 0, 0}, {0, 0, 0}, {0, -1, 0}, 16, 16);
  HOLD(side.w2c[8] == -1 && side.w2c[11] == 2 && side.w2c[5] == 1);
  HOLD(status_of([] { vsplat::looking_at({0, 1, 0}, {0, 0, 0}, {0, 1, 0}, 16, 16); }) == VSPLAT_ERROR_INPUT);
  HOLD(status_of([] { vsplat::looking_at({0, 1, 0}, {0, 1, 0}, {0, 1, 0}, 16, 16); }) == VSPLAT_ERROR_INPUT);
  HOLD(status_of([] { vsplat::looking_at({0, 1, NAN}, {0, 1, 0}, {0, 1, 0}, 16, 16); }) == VSPLAT_ERROR_INPUT);
  const std::array<vsplat_camera, 2> keys{front, side};
  const vsplat::Cameras cameras = vsplat::Cameras::create(keys);
  HOLD(cameras.all().size() == 2 && same_bits(&cameras.all()[1], &side, sizeof side));
  HOLD(cameras.path(5).all().size() == 5);
  HOLD(status_of([] { vsplat::Cameras::create({}); }) == VSPLAT_ERROR_USAGE);
  HOLD(with.input.camera(0).width == with.input.info().image);
  const std::vector<float> seen = with.input.picture(0), dark(seen.size());
  const auto edge = static_cast<int32_t>(with.input.info().image);
  HOLD(vsplat::compare(seen, seen, edge, edge).psnr > 1e6 && vsplat::compare(seen, dark, edge, edge).psnr < 20);
  const Scene scene =
      vsplat::reconstruct(with.device, with.model, with.input, [](const char*, double) { return true; });
  HOLD(scene.info().count > 0 && scene.orbit().all().size() == 8);
  HOLD(Device::open().info().memory == with.device.info().memory);
}

void jobs_end_with_what_they_made(const Setting& with) {
  const Gaussians expected = with.scene().gaussians();
  std::atomic<int> ended{0}, calls{0};
  vsplat::JobFunctions functions;
  functions.progress = [&](const char*, double) { return ++calls > 0; };
  functions.on_end = [&] { ++ended; };
  const Job job = vsplat::reconstruct_async(with.device, with.model, with.input, with.options, functions);
  const Scene scene = job.scene();
  HOLD(are_equal(scene.gaussians(), expected));
  HOLD(calls > 3);

  std::array<Picture, 1> pictures{Picture(16, 16)};
  const std::array<PictureSpans, 1> into{pictures[0]};
  const Job drawing = vsplat::render_async(with.device, scene, {&with.camera, 1}, into);
  drawing.finish();
  HOLD(ended == 1);
  HOLD(drawing.state() == VSPLAT_JOB_DONE);
  HOLD(pictures[0].colour == vsplat::render(with.device, scene, with.camera).colour);

  functions.progress = [](const char*, double) -> bool { throw std::out_of_range("enough"); };
  bool thrown = false;
  const Job failing = vsplat::reconstruct_async(with.device, with.model, with.input, with.options, functions);
  try {
    failing.scene();
  } catch (const std::out_of_range&) {
    thrown = true;
  }
  HOLD(thrown);
  HOLD(failing.state() == VSPLAT_JOB_CANCELLED);

  // If it cannot begin, its functions are released.
  const auto held = std::make_shared<int>(7);
  vsplat::JobFunctions holding;
  holding.on_end = [held] {};
  HOLD(status_of([&] { vsplat::reconstruct_async(Device(), with.model, with.input, with.options, holding); }) ==
       VSPLAT_ERROR_USAGE);
  holding.on_end = nullptr;
  HOLD(held.use_count() == 1);
}

// A scene of `count` Gaussians side by side, of which the middle one is at `middle` x.
Scene in_a_row(size_t count, float middle) {
  Gaussians g(count, 0);
  const size_t before = count / 2;
  for (size_t k = 0; k < count; ++k) {
    g.means[3 * k] = middle + 0.25f * (static_cast<float>(k) - static_cast<float>(before));
    g.rotations[4 * k] = 1;
    g.opacities[k] = 0.9f;
    for (size_t c = 0; c < 3; ++c) g.scales[3 * k + c] = c == 1 ? 0.02f : 0.05f, g.sh[3 * k + c] = 1;
  }
  return Scene::create(g, 0);
}

void scenes_are_edited() {
  Scene scene = in_a_row(3, 0);
  const Scene other = in_a_row(1, 0);
  const double twice[16] = {2, 0, 0, 1, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
  scene.append(other);
  scene.append(other, twice);
  HOLD((scene.gaussians().means == std::vector<float>{-0.25f, 0, 0, 0, 0, 0, 0.25f, 0, 0, 0, 0, 0, 1, 0, 0}));
  HOLD(scene.gaussians().scales[12] == 0.1f && other.info().count == 1);
  const std::array<uint8_t, 5> removed{1, 0, 0, 1, 0};
  scene.remove(removed);
  HOLD((scene.gaussians().means == std::vector<float>{0, 0, 0, 0.25f, 0, 0, 1, 0, 0}));
  HOLD(status_of([&] { scene.remove(removed); }) == VSPLAT_ERROR_USAGE);  // it has three now
  scene.crop({-0.1, -1, -1}, {0.5, 1, 1});
  HOLD(scene.info().count == 2);
  scene.transform(twice);
  HOLD((scene.gaussians().means == std::vector<float>{1, 0, 0, 1.5f, 0, 0}));
  const double sheared[16] = {1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  HOLD(status_of([&] { scene.transform(sheared); }) != VSPLAT_OK && scene.info().count == 2);
}

void files_are_made_in_memory(const Setting& with) {
  const Scene scene = in_a_row(3, 0);
  const std::vector<unsigned char> ply = scene.save_memory();
  HOLD(ply.size() > 100 && same_bits(ply.data(), "ply", 3));
  HOLD(Scene::load(ply).gaussians().means == scene.gaussians().means);
  HOLD(Model::load(with.model.save_memory()).info().parameters == with.model.info().parameters);
  HOLD(with.model.save_memory(VSPLAT_DTYPE_F16).size() < with.model.save_memory().size());
  const Picture picture = vsplat::render(with.device, scene, with.camera);
  const std::vector<unsigned char> png = picture.save_memory(VSPLAT_PICTURE_PNG);
  HOLD(png.size() > 60 && same_bits(png.data(), "\x89PNG", 4));
  HOLD(status_of([] { Picture().save_memory(VSPLAT_PICTURE_PNG); }) == VSPLAT_ERROR_USAGE);
}

void scenes_have_formats() {
  const Scene scene = in_a_row(3, 1);
  int written = 0;
  for (const vsplat_scene_format& format : vsplat::scene_formats()) {
    HOLD(format.lossless == (scene.losses(format.name).empty() ? 1 : 0));
    if (!format.writes) continue;
    ++written;
    vsplat_scene_save_options options = VSPLAT_SCENE_SAVE_OPTIONS_INIT;
    options.format = format.name;
    const std::vector<unsigned char> held = scene.save_memory(options);
    HOLD(Scene::load(held).info().count == 3);
    scene.save("cpp_test_scene", options);
    HOLD(Scene::load("cpp_test_scene").info().count == 3);
  }
  HOLD(written >= 4);
  std::remove("cpp_test_scene");
  vsplat_scene_save_options old = VSPLAT_SCENE_SAVE_OPTIONS_INIT;
  old.format = "spz";
  old.spz_version = 1;
  HOLD(status_of([&] { scene.save_memory(old); }) == VSPLAT_ERROR_USAGE);
  HOLD(status_of([&] { scene.save("cpp_test_scene.obj"); }) == VSPLAT_ERROR_USAGE);
}

// The Gaussians are flat along y and two deep: what is hit, how far it is and which way it looks is known.
void surfaces_and_bytes_are_drawn(const Setting& with) {
  const Scene scene = in_a_row(3, 0);
  Picture picture(16, 16);
  vsplat::render(with.device, scene, with.camera, picture.add_surfaces());
  const size_t middle = 8 * 16 + 8;
  HOLD(picture.ids[middle] == 1 && picture.ids[middle - 3] == 0 && picture.ids[middle + 2] == 2 &&
       picture.ids[0] == -1);
  HOLD(std::abs(picture.median[middle] - 2) < 1e-5f && picture.median[0] == 0);
  HOLD(std::abs(picture.expected[middle] - 2) < 1e-4f);
  HOLD(std::abs(std::abs(picture.normal[3 * middle + 1]) - picture.alpha[middle]) < 1e-3f);
  HOLD(picture.colour == vsplat::render(with.device, scene, with.camera).colour);

  std::vector<unsigned char> frame(16 * 100, 77);
  vsplat::render_bytes(with.device, scene, with.camera, frame, 3, 100);
  bool rounded = true, kept = true;
  for (size_t i = 0; i < frame.size(); ++i) {
    if (i % 100 >= 48)
      kept = kept && frame[i] == 77;
    else
      rounded = rounded && std::abs(255 * std::min(picture.colour[48 * (i / 100) + i % 100], 1.0f) -
                                    static_cast<float>(frame[i])) < 0.51f;
  }
  HOLD(rounded && kept);
  HOLD(status_of([&] {
         vsplat::render_bytes(with.device, scene, with.camera, Span<unsigned char>(frame.data(), 1000), 3, 100);
       }) == VSPLAT_ERROR_USAGE);
}

static_assert(std::is_nothrow_move_constructible_v<Scene> && std::is_nothrow_move_assignable_v<Scene>);
static_assert(std::is_nothrow_move_constructible_v<Picture> && std::is_nothrow_move_constructible_v<Gaussians>);
static_assert(std::is_nothrow_move_constructible_v<Job>);
static_assert(!std::is_convertible_v<std::vector<double>&, Span<float>>);
static_assert(!std::is_convertible_v<const std::vector<float>&, Span<float>>);
static_assert(std::is_convertible_v<std::vector<float>&, Span<const float>>);
struct NamedSpans : PictureSpans {
  int name = 0;
};
static_assert(std::is_convertible_v<std::vector<PictureSpans>&, Span<const PictureSpans>>);
static_assert(!std::is_convertible_v<std::vector<NamedSpans>&, Span<const PictureSpans>>);

}  // namespace

int main() try {
  const Setting with;
  lambdas_are_called_and_what_they_throw_comes_out(with);
  messages_reach_a_lambda();
  spans_are_read_and_written_where_they_lie(with);
  a_profile_is_reported_in_rows(with);
  cameras_are_made(with);
  jobs_end_with_what_they_made(with);
  scenes_are_edited();
  files_are_made_in_memory(with);
  scenes_have_formats();
  surfaces_and_bytes_are_drawn(with);
  if (failures == 0) std::puts("all holds");
  return failures == 0 ? 0 : 1;
} catch (const std::exception& e) {
  std::printf("%s\n", e.what());
  return 1;
}
