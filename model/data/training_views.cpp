#include "model/data/training_views.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <limits>
#include <set>
#include <thread>

#include "model/data/byte_cache.h"
#include "model/data/disguise.h"
#include "model/data/drawn_views.h"
#include "model/data/endless_objects.h"
#include "model/data/interior.h"
#include "model/views/pose_check.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

constexpr std::size_t listing_bytes = std::size_t{64} << 20;  // cached listings of objects
constexpr int endless_views = 40;  // of a procedural object, as the command draws them; few are requested

void check(const DataSet& data, const TrainingOptions& o) {
  if (data.objects.empty() && o.procedural < 1) fail(Status::input, "the data set has no objects");
  const auto expect = [](bool good, const char* what) {
    if (!good) fail(Status::usage, "reading for training: {}", what);
  };
  expect(o.image >= 1, "the pictures' size must be positive");
  expect(o.rebase == "rotate" || o.rebase == "move", "rebase must be rotate or move");
  expect(o.batch >= 1, "a step has at least one item");
  expect(o.min_inputs >= 1 && o.min_inputs <= o.max_inputs && o.max_inputs <= max_views, "1 to 16 input views");
  expect(o.novel >= 0 && o.novel <= 1000, "0 to 1000 novel views");
  expect(o.first_listed >= 0 && o.first_listed <= 1, "the share of first listed input views is 0 to 1");
  expect(o.turn_degrees >= 0 && o.turn_degrees <= 180, "a turn by 0 to 180 degrees");
  expect(o.min_cube > 0 && o.min_cube <= o.max_cube && o.max_cube < 1e3, "the cube's factors must be positive");
  expect(o.mirror >= 0 && o.mirror <= 1, "the share of mirrored objects is 0 to 1");
  expect(o.shuffle_channels >= 0 && o.shuffle_channels <= 1, "the share of objects in other colours is 0 to 1");
  expect(o.rooms >= 0 && o.rooms <= 1, "the share of objects in a room is 0 to 1");
  expect(o.procedural >= 0 && o.procedural <= 1, "the share of procedural objects is 0 to 1");
  expect(o.threads >= 0 && o.threads <= 256 && o.ahead >= 0, "threads and items ahead cannot be negative");
}

struct Listing {
  FramedObject object;
  std::vector<Eigen::Vector3d> positions;
};

std::vector<Eigen::Vector3d> positions_of(const FramedObject& object) {
  std::vector<Eigen::Vector3d> out;
  for (const ListedView& view : object.photographs.set.views) out.push_back(view.camera.centre());
  return out;
}

std::size_t bytes_of(const Listing& listing) {
  return listing.positions.size() *
         (sizeof(ListedView) + sizeof(Eigen::Vector3d) + 256);  // paths and names, approximately
}

Eigen::Matrix3d random_turn(double degrees, Random& random) {
  const double height = random.uniform(-1, 1), azimuth = random.uniform(0, 2 * M_PI),
               angle = random.uniform(0, degrees) * M_PI / 180;
  const double level = std::sqrt(1 - height * height);
  const Eigen::Vector3d axis(level * std::cos(azimuth), level * std::sin(azimuth), height);
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

// The object's index and the view: its index, -1 for the object as a whole, or -2 and below for a view omitted when the
// object was opened.
using BadThing = std::pair<std::size_t, int>;
constexpr int whole = -1;
// Index of an object that is not in the set; its pictures are requested once and not cached.
constexpr std::size_t no_index = std::numeric_limits<std::size_t>::max();

struct Item {
  enum class State { wanted, begun, done } state = State::wanted;
  TrainingViews views;
  std::exception_ptr error;
};

std::vector<std::uint8_t> premultiplied_bytes(const StoredView& view) {
  if (view.opaque || !view.masked) return {};
  std::vector<std::uint8_t> out = view.rgba;
  for (std::size_t i = 0; i < out.size(); i += 4)
    for (std::size_t c = i; c < i + 3; ++c) out[c] = static_cast<std::uint8_t>((out[c] * out[i + 3] + 127) / 255);
  return out;
}

}  // namespace

struct TrainingReader::Impl {
  Impl(DataSet d, TrainingOptions o)
      : data(std::move(d)), options(std::move(o)), listings(listing_bytes), pictures(options.cache_bytes) {
    check(data, options);
    if (!options.textures.empty()) textures.emplace(options.textures);
    request.image = options.image, request.crop = options.crop, request.placement = options.placement;
    request.to_train_on = true;
    for (int i = 0; i < options.threads; ++i) workers.emplace_back([this] { work(); });
  }
  ~Impl() {
    {
      const std::lock_guard lock(mutex);
      stop = true;
    }
    changed.notify_all();
    for (std::thread& worker : workers) worker.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::shared_ptr<const Listing> listing(std::size_t index);
  std::shared_ptr<const StoredView> picture(std::size_t index, const FramedObject& object, int view);
  void note(BadThing thing, const std::string& what);
  bool passed_over(BadThing thing, const Error& error);
  TrainingViews take(const Listing& from, std::size_t index, Random& random);
  TrainingViews composed(const Listing& from, int inputs, const std::vector<std::shared_ptr<const StoredView>>& views,
                         Random& random) const;
  std::vector<std::shared_ptr<const StoredView>> shown(const std::vector<std::shared_ptr<const StoredView>>& views,
                                                       const std::vector<Camera>& cameras, Random& random) const;
  void disguise(TrainingViews& views, Random& random) const;
  Listing random_listing(std::uint64_t number);
  TrainingViews make(std::uint64_t item);
  void finish(std::uint64_t number, std::unique_lock<std::mutex>& lock);  // makes a wanted item, with the lock released
                                                                          // meanwhile
  void work();

  const DataSet data;
  const TrainingOptions options;
  FrameRequest request;
  std::optional<TextureFolder> textures;
  ByteCache<std::size_t, Listing> listings;
  ByteCache<std::pair<std::size_t, int>, StoredView> pictures;

  std::atomic<int> masks_looked_at = 0;  // number of objects whose masks were checked

  mutable std::mutex bad_mutex;
  std::set<BadThing> bad;

  std::mutex mutex;  // guards the following members
  std::condition_variable changed;
  std::map<std::uint64_t, Item> items;
  bool stop = false;
  std::vector<std::thread> workers;
};

std::shared_ptr<const Listing> TrainingReader::Impl::listing(std::size_t index) {
  if (auto found = listings.find(index)) return found;
  std::vector<std::string> skipped;
  auto made = std::make_shared<Listing>();
  try {
    made->object = frame_object(data.objects[index], request, options.skip_bad ? &skipped : nullptr);
  } catch (const Error& e) {
    if (!passed_over({index, whole}, e)) throw;
    return nullptr;
  }
  constexpr int objects_looked_at = 8;
  if (masks_looked_at++ < objects_looked_at) warn_of_inverted_masks(made->object, 4);
  for (std::size_t i = 0; i < skipped.size(); ++i) note({index, whole - 1 - static_cast<int>(i)}, skipped[i]);
  made->positions = positions_of(made->object);
  listings.put(index, made, bytes_of(*made));
  return made;
}

std::shared_ptr<const StoredView> TrainingReader::Impl::picture(std::size_t index, const FramedObject& object,
                                                                int view) {
  if (index == no_index) return std::make_shared<const StoredView>(store_view(object, view, request));
  if (auto found = pictures.find({index, view})) return found;
  auto made = std::make_shared<const StoredView>(store_view(object, view, request));
  pictures.put({index, view}, made, made->rgba.size() + sizeof(StoredView));
  return made;
}

void TrainingReader::Impl::note(BadThing thing, const std::string& what) {
  {
    const std::lock_guard lock(bad_mutex);
    if (!bad.insert(thing).second) return;
  }
  warn("{}; it is skipped", what);
}

bool TrainingReader::Impl::passed_over(BadThing thing, const Error& error) {
  if (!options.skip_bad || !is_about_data(error)) return false;
  note(thing, error.what());
  return true;
}

TrainingViews TrainingReader::Impl::composed(const Listing& from, int inputs,
                                             const std::vector<std::shared_ptr<const StoredView>>& views,
                                             Random& random) const {
  TrainingViews out;
  out.object = from.object.name;
  out.inputs = inputs;
  const float shade = 0.5f * static_cast<float>(random.below(3));
  bool opaque = false;
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const auto& view : views) {
    opaque = opaque || (static_cast<int>(cameras.size()) >= inputs && view->opaque);
    cameras.push_back(view->camera);
  }
  if (options.random_background && !opaque) out.background = {shade, shade, shade};

  Placement placement = from.object.placement;
  const PlacedViews listed = place_views(cameras, placement, options.rebase);
  try {
    check_cube_is_in_front(listed.cameras, placement);
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", from.object.label, e.what());
  }
  placement.edge *= random.uniform(options.min_cube, options.max_cube);
  out.cameras = place_views(cameras, placement, options.rebase).cameras;
  Similarity turn;
  turn.rotation = random_turn(options.turn_degrees, random);
  if (options.turn_degrees > 0)
    for (Camera& camera : out.cameras) camera = to_frame(camera, turn);

  const auto seen = shown(views, out.cameras, random);
  out.pictures.reserve(seen.size() * 3 * static_cast<std::size_t>(options.image) * options.image);
  for (std::size_t i = 0; i < seen.size(); ++i)
    composite(*seen[i], static_cast<int>(i) < inputs ? std::array<float, 3>{1, 1, 1} : out.background, out.pictures);
  if (options.alpha)
    for (const auto& view : seen) out.rgba.push_back(premultiplied_bytes(*view));
  disguise(out, random);
  return out;
}

// Draws no random number for a disabled option, here and in disguise(), so that other runs stay the same.
std::vector<std::shared_ptr<const StoredView>> TrainingReader::Impl::shown(
    const std::vector<std::shared_ptr<const StoredView>>& views, const std::vector<Camera>& cameras,
    Random& random) const {
  if (!(options.rooms > 0 && random.uniform(0, 1) < options.rooms)) return views;
  const Room room = random_room(random, textures ? &*textures : nullptr);
  std::vector<std::shared_ptr<const StoredView>> out;
  out.reserve(views.size());
  for (std::size_t i = 0; i < views.size(); ++i)
    out.push_back(std::make_shared<const StoredView>(in_room(*views[i], cameras[i], room)));
  return out;
}

void TrainingReader::Impl::disguise(TrainingViews& views, Random& random) const {
  if (options.mirror > 0 && random.uniform(0, 1) < options.mirror) mirror(views);
  if (options.shuffle_channels > 0 && random.uniform(0, 1) < options.shuffle_channels) {
    static constexpr std::array<std::array<int, 3>, 5> others = {
        {{0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
    shuffle_channels(views, others[static_cast<std::size_t>(random.below(5))]);
  }
}

// Draws again, without the bad views, if any view is bad. For a random object this is no fault of the data: it may be
// too thin to be visible from some direction.
TrainingViews TrainingReader::Impl::take(const Listing& from, std::size_t index, Random& random) {
  std::vector<bool> excluded(from.positions.size(), false);
  const int inputs = options.min_inputs + random.below(options.max_inputs - options.min_inputs + 1);
  const bool first = options.first_listed > 0 && random.uniform(0, 1) < options.first_listed;
  for (;;) {
    const DrawnViews drawn = draw_views(from.positions, excluded, inputs, options.novel, first, random);
    if (drawn.inputs.empty())
      fail(Status::input, "{}: {} of its {} views can be used, {} input views are asked for", from.object.label,
           std::count(excluded.begin(), excluded.end(), false), excluded.size(), inputs);
    std::vector<int> chosen = drawn.inputs;
    chosen.insert(chosen.end(), drawn.novel.begin(), drawn.novel.end());
    std::vector<std::shared_ptr<const StoredView>> views;
    for (const int view : chosen) {
      try {
        views.push_back(picture(index, from.object, view));
      } catch (const Error& e) {
        if (index != no_index && !passed_over({index, view}, e)) throw;
        excluded[static_cast<std::size_t>(view)] = true;
      }
    }
    if (views.size() == chosen.size()) return composed(from, inputs, views, random);
  }
}

Listing TrainingReader::Impl::random_listing(std::uint64_t number) {
  Listing out;
  const int views = std::max(endless_views, options.max_inputs + options.novel);
  const auto drawn = [&](const TextureFolder* folder) {
    return endless_object(options.seed, static_cast<std::uint32_t>(number), views, options.image, folder);
  };
  try {
    out.object = drawn(textures ? &*textures : nullptr);
  } catch (const Error& e) {  // a texture that cannot be read
    if (!passed_over({no_index, whole}, e)) throw;
    out.object = drawn(nullptr);
  }
  out.positions = positions_of(out.object);
  return out;
}

// A random object, or the set's next object; if that is bad, the one after it.
TrainingViews TrainingReader::Impl::make(std::uint64_t item) {
  Random random(options.seed, static_cast<std::uint32_t>(item), draw_stream);
  const EndlessShare share(options.procedural);
  if (share.is_random(item)) return take(random_listing(item), no_index, random);
  const std::uint64_t number = share.others_before(item), count = data.objects.size();
  const auto round = static_cast<std::uint32_t>(number / count);
  for (std::uint64_t attempt = 0; attempt < count; ++attempt) {
    const std::size_t index = shuffled((number + attempt) % count, count, options.seed, round);
    const std::shared_ptr<const Listing> from = listing(index);
    if (!from) continue;
    try {
      return take(*from, index, random);
    } catch (const Error& e) {
      if (!passed_over({index, whole}, e)) throw;
    }
  }
  fail(Status::input, "none of the {} objects can be used", count);
}

void TrainingReader::Impl::finish(std::uint64_t number, std::unique_lock<std::mutex>& lock) {
  items[number].state = Item::State::begun;
  lock.unlock();
  Item made;
  made.state = Item::State::done;
  try {
    made.views = make(number);
  } catch (...) {
    made.error = std::current_exception();
  }
  lock.lock();
  if (const auto at = items.find(number); at != items.end()) at->second = std::move(made);
  changed.notify_all();
}

void TrainingReader::Impl::work() {
  std::unique_lock lock(mutex);
  while (!stop) {
    const auto next =
        std::find_if(items.begin(), items.end(), [](const auto& i) { return i.second.state == Item::State::wanted; });
    if (next == items.end()) {
      changed.wait(lock);
    } else {
      finish(next->first, lock);
    }
  }
}

TrainingReader::TrainingReader(DataSet data, TrainingOptions options)
    : impl_(std::make_unique<Impl>(std::move(data), std::move(options))) {}

TrainingReader::~TrainingReader() = default;

TrainingViews TrainingReader::at(long step, int item) {
  Impl& m = *impl_;
  const int last_item = m.options.last_item < 0 ? m.options.batch : m.options.last_item;
  if (step < 0 || item < m.options.first_item || item >= last_item)
    fail(Status::internal, "item {} of step {}; a step has {} to {}", item, step, m.options.first_item, last_item);
  const std::uint64_t number = static_cast<std::uint64_t>(step) * m.options.batch + item;
  const std::uint64_t ahead = m.options.threads > 0 ? m.options.ahead : 0;
  std::unique_lock lock(m.mutex);
  // The next items to be requested.
  std::set<std::uint64_t> wanted;
  for (std::uint64_t i = number; wanted.size() <= ahead; ++i) {
    const int of_step = static_cast<int>(i % static_cast<std::uint64_t>(m.options.batch));
    if (of_step >= m.options.first_item && of_step < last_item) wanted.insert(i);
  }
  std::erase_if(m.items, [&](const auto& i) { return wanted.count(i.first) == 0; });
  for (const std::uint64_t i : wanted) m.items.try_emplace(i);
  m.changed.notify_all();
  if (m.items[number].state == Item::State::wanted) m.finish(number, lock);
  m.changed.wait(lock, [&] { return m.items[number].state == Item::State::done; });
  Item done = std::move(m.items[number]);
  m.items.erase(number);
  lock.unlock();
  if (done.error) std::rethrow_exception(done.error);
  return done.views;
}

int TrainingReader::bad() const {
  const std::lock_guard lock(impl_->bad_mutex);
  return static_cast<int>(impl_->bad.size());
}

std::size_t TrainingReader::cached_bytes() const { return impl_->pictures.bytes(); }

}  // namespace vsplat
