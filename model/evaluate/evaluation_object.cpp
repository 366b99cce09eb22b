#include "model/evaluate/evaluation_object.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "model/views/pose_check.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr std::array<float, 3> kWhite{1, 1, 1};

struct Chosen {
  std::vector<int> inputs, novel;  // indices of the object's views
  std::vector<std::size_t> nearest;
};

// Chooses among the readable views.
Chosen choose(const FramedObject& object, const std::vector<int>& good, int inputs, const EvaluationRequest& request) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(good.size());
  for (const int view : good)
    positions.push_back(object.photographs.set.views[static_cast<std::size_t>(view)].camera.centre());
  // In a set with splits, pictures of test views are never inputs. If there is no test split, the validation views are
  // used.
  std::vector<bool> to_test;
  const auto part = [&](Split split) {
    to_test.clear();
    for (const int view : good)
      to_test.push_back(object.photographs.set.views[static_cast<std::size_t>(view)].split == split);
    return std::find(to_test.begin(), to_test.end(), true) != to_test.end();
  };
  const bool has_parts = part(Split::test) || part(Split::val);
  const EvaluationViews views =
      has_parts ? evaluation_views_of_parts(positions, to_test, inputs, request.protocol, request.seed, object.name)
                : evaluation_views(positions, inputs, request.protocol, request.seed, object.name);
  Chosen out;
  for (const int i : views.inputs) out.inputs.push_back(good[static_cast<std::size_t>(i)]);
  for (const int i : views.novel) {
    out.novel.push_back(good[static_cast<std::size_t>(i)]);
    const int nearest =
        nearest_view(positions, views.inputs, positions[static_cast<std::size_t>(i)], object.placement.centre);
    out.nearest.push_back(
        static_cast<std::size_t>(std::find(views.inputs.begin(), views.inputs.end(), nearest) - views.inputs.begin()));
  }
  return out;
}

Image on_white(const StoredView& view) {
  Image picture;
  picture.width = view.camera.width, picture.height = view.camera.height;
  picture.channels = 3;
  composite(view, kWhite, picture.data);
  return picture;
}

// PreparedView::alpha of a view.
Image alpha_of(const StoredView& view) {
  if (view.opaque) return {};
  Image out(view.camera.width, view.camera.height, 1);
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] = static_cast<float>(view.rgba[4 * i + 3]) / 255.0f;
  return out;
}

// EvaluationObject::shown of a view.
Image shown(const StoredView& view) { return view.masked ? Image() : alpha_of(view); }

// Decodes the views. Returns the first that cannot be decoded; none if `out` is complete.
std::optional<int> decode(const FramedObject& object, const Chosen& chosen, const FrameRequest& request,
                          std::vector<std::string>* skipped, EvaluationObject& out) {
  FrameRequest compared = request;
  compared.image = out.compared_size;
  for (const std::vector<int>* views : {&chosen.inputs, &chosen.novel})
    for (const int view : *views) try {
        const bool is_input = views == &chosen.inputs;
        // Made from the original photograph: another size is resampled from there, by area.
        const StoredView stored = store_view(object, view, is_input ? request : compared);
        out.pictures.push_back(on_white(stored));
        out.cameras.push_back(stored.camera);
        if (is_input)
          out.alphas.push_back(alpha_of(stored)), out.masked.push_back(stored.masked);
        else
          out.shown.push_back(shown(stored));
        if (is_input && compared.image != request.image)
          out.inputs_compared.push_back(on_white(store_view(object, view, compared)));
      } catch (const Error& e) {
        if (!skipped || !is_about_data(e)) throw;
        skipped->emplace_back(e.what());
        return view;
      }
  return std::nullopt;
}

}  // namespace

EvaluationObject evaluation_object(const DataObject& object, const TakenViews& taken, const EvaluationRequest& request,
                                   std::vector<std::string>* skipped, std::vector<std::string>* missing) {
  std::vector<std::string> ignored;
  const FrameRequest frame{taken.image, request.crop, request.placement, missing ? missing : &ignored};
  const FramedObject framed = frame_object(object, frame, skipped);
  warn_of_inverted_masks(framed, 4);
  std::vector<int> good(static_cast<std::size_t>(framed.views()));
  std::iota(good.begin(), good.end(), 0);
  EvaluationObject out;
  const int inputs = request.inputs > 0 ? request.inputs : taken.trained;
  while (true) {
    if (good.empty()) fail(Status::input, "{}: no view of it is left", label_of(object));
    const Chosen chosen = choose(framed, good, inputs, request);
    out = {};
    out.name = object.name;
    out.inputs = chosen.inputs.size();
    out.compared_size = request.compared_size > 0 ? request.compared_size : taken.image;
    out.nearest = chosen.nearest;
    out.input_views = chosen.inputs;
    const std::optional<int> bad = decode(framed, chosen, frame, skipped, out);
    if (!bad) break;
    std::erase(good, *bad);
  }
  PlacedViews placed = place_views(out.cameras, framed.placement, taken.rebase);
  out.cameras = std::move(placed.cameras);
  out.to_world = placed.to_world;
  try {
    check_cube_is_in_front(std::span(out.cameras).first(out.inputs), framed.placement);
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", label_of(object), e.what());
  }
  out.framed = framed;
  return out;
}

}  // namespace vsplat
