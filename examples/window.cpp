// A scene in a window, drawn live: drag to turn it, roll the wheel to come nearer, press Space to let it turn.
//
//     vsplat-window SCENE.ply [FRAMES [PICTURE.png]]
//
// FRAMES: turns by itself at full size for so many frames, then ends; PICTURE.png is what the window shows at the end.
// The library draws 8-bit pixels straight into SDL's texture, whose rows may have gaps.
#include <SDL.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace {

constexpr int kDirections = 720;      // positions on the circle
constexpr double kSmooth = 1.0 / 20;  // target time of a frame in seconds while something moves

void need(bool good) {
  if (!good) throw std::runtime_error(SDL_GetError());
}

template <class T, void (*Destroy)(T*)>
struct Destroyer {
  void operator()(T* it) const { Destroy(it); }
};
using Window = std::unique_ptr<SDL_Window, Destroyer<SDL_Window, SDL_DestroyWindow>>;
using Renderer = std::unique_ptr<SDL_Renderer, Destroyer<SDL_Renderer, SDL_DestroyRenderer>>;
using Texture = std::unique_ptr<SDL_Texture, Destroyer<SDL_Texture, SDL_DestroyTexture>>;

// The viewpoint: a direction on a circle about the scene.
class Orbit {
 public:
  explicit Orbit(const vsplat::Scene& scene) : scene_(scene) {}

  void turn(double directions) { direction_ += directions; }
  void rise(double degrees) { move(elevation_ + degrees, nearness_); }
  void approach(double factor) { move(elevation_, nearness_ * factor); }

  vsplat_camera camera(int width, int height) {
    if (!circle_ || width != width_ || height != height_) {
      vsplat_orbit_options options = VSPLAT_ORBIT_OPTIONS_INIT;
      options.count = kDirections;
      options.width = width_ = width, options.height = height_ = height;
      options.has_elevation = 1, options.elevation = elevation_;
      if (radius_ == 0) radius_ = radius_of(scene_.orbit(options));
      options.radius = radius_ / nearness_;
      circle_ = scene_.orbit(options);
    }
    int which = static_cast<int>(direction_) % kDirections;
    if (which < 0) which += kDirections;
    vsplat_camera out = VSPLAT_CAMERA_INIT;
    vsplat::check(vsplat_cameras_get(circle_.get(), static_cast<size_t>(which), &out));
    return out;
  }

 private:
  // Half the distance between two cameras that face each other.
  static double radius_of(const vsplat::Cameras& circle) {
    const std::vector<vsplat_camera> all = circle.all();
    double squares = 0;
    for (int axis = 0; axis < 3; ++axis) {
      double across = 0;  // a camera's centre is -R^T t
      for (int i = 0; i < 3; ++i)
        across += all[kDirections / 2].w2c[4 * i + axis] * all[kDirections / 2].w2c[4 * i + 3] -
                  all[0].w2c[4 * i + axis] * all[0].w2c[4 * i + 3];
      squares += across * across;
    }
    return std::sqrt(squares) / 2;
  }
  void move(double elevation, double nearness) {
    elevation_ = std::clamp(elevation, -85.0, 85.0);
    nearness_ = std::clamp(nearness, 0.2, 5.0);
    circle_ = {};
  }

  const vsplat::Scene& scene_;
  vsplat::Cameras circle_;
  int width_ = 0, height_ = 0;
  double direction_ = 0, elevation_ = 10, nearness_ = 1, radius_ = 0;
};

class Viewer {
 public:
  Viewer(const char* path, int frames) : scene_(vsplat::Scene::load(path)), orbit_(scene_), frames_(frames) {
    window_.reset(SDL_CreateWindow(path, SDL_WINDOWPOS_UNDEFINED, SDL_WINDOWPOS_UNDEFINED, 640, 480,
                                   SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI));
    need(window_ != nullptr);
    renderer_.reset(SDL_CreateRenderer(window_.get(), -1, 0));
    need(renderer_ != nullptr);
  }

  void run() {
    for (int shown = 0; !quit_ && (frames_ == 0 || shown < frames_); ++shown) {
      if (frames_ == 0 && !turning_ && !stale_) need(SDL_WaitEvent(nullptr) == 1);
      for (SDL_Event event; SDL_PollEvent(&event);) take(event);
      if (turning_ || frames_ > 0) orbit_.turn(kDirections / 180.0), stale_ = true;
      if (stale_) show(frames_ == 0 && (moving_ || turning_));
    }
  }

  // Saves what the window shows.
  void save(const char* path) {
    int width = 0, height = 0;
    need(SDL_GetRendererOutputSize(renderer_.get(), &width, &height) == 0);
    std::vector<unsigned char> pixels(3 * static_cast<size_t>(width) * static_cast<size_t>(height));
    draw_texture();
    need(SDL_RenderReadPixels(renderer_.get(), nullptr, SDL_PIXELFORMAT_RGB24, pixels.data(), 3 * width) == 0);
    vsplat::Picture picture(width, height);
    for (size_t i = 0; i < pixels.size(); ++i) picture.colour[i] = static_cast<float>(pixels[i]) / 255.0f;
    picture.save(path, VSPLAT_PICTURE_PNG);
  }

 private:
  void take(const SDL_Event& event) {
    if (event.type == SDL_QUIT || (event.type == SDL_KEYDOWN && event.key.keysym.sym == SDLK_ESCAPE)) quit_ = true;
    if (event.type == SDL_KEYDOWN && event.key.keysym.sym == SDLK_SPACE) turning_ = !turning_, stale_ = true;
    if (event.type == SDL_MOUSEBUTTONDOWN) moving_ = true;
    if (event.type == SDL_MOUSEBUTTONUP) moving_ = false, stale_ = stale_ || !sharp_;
    if (event.type == SDL_MOUSEMOTION && moving_) {
      orbit_.turn(-event.motion.xrel * kDirections / 720.0);
      orbit_.rise(event.motion.yrel * 0.4);
      stale_ = true;
    }
    if (event.type == SDL_MOUSEWHEEL && event.wheel.y != 0)
      orbit_.approach(event.wheel.y > 0 ? 1.1 : 1 / 1.1), stale_ = true;
    if (event.type == SDL_WINDOWEVENT) take(event.window);
  }

  void take(const SDL_WindowEvent& event) {
    if (event.event == SDL_WINDOWEVENT_SIZE_CHANGED) stale_ = true;
    if (event.event != SDL_WINDOWEVENT_EXPOSED || !texture_) return;
    draw_texture();
    SDL_RenderPresent(renderer_.get());
  }

  // Draws smaller while something moves, to keep the frame rate; SDL scales the picture up.
  void show(bool quickly) {
    int width = 0, height = 0;
    need(SDL_GetRendererOutputSize(renderer_.get(), &width, &height) == 0);
    while (quickly && seconds_ > 1.5 * kSmooth && smaller_ < 8) smaller_ *= 2, seconds_ /= 4;
    while (quickly && seconds_ < kSmooth / 4 && smaller_ > 1) smaller_ /= 2, seconds_ *= 4;
    const int by = quickly ? smaller_ : 1;
    width = std::max(width / by, 1), height = std::max(height / by, 1);
    if (width != width_ || height != height_) {
      texture_.reset(
          SDL_CreateTexture(renderer_.get(), SDL_PIXELFORMAT_RGB24, SDL_TEXTUREACCESS_STREAMING, width, height));
      need(texture_ != nullptr);
      width_ = width, height_ = height;
    }

    vsplat_picture picture = VSPLAT_PICTURE_INIT;
    picture.capacity = static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
    picture.type = VSPLAT_PIXELS_U8;
    int pitch = 0;
    const vsplat_camera camera = orbit_.camera(width, height);
    need(SDL_LockTexture(texture_.get(), nullptr, &picture.data, &pitch) == 0);
    picture.row_bytes = static_cast<size_t>(pitch);
    vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
    options.supersample = quickly ? 1 : 0;  // a frame drawn small for speed is not supersampled
    const Uint64 begun = SDL_GetPerformanceCounter();
    const vsplat_status status = vsplat_render(device_.get(), scene_.get(), &camera, &options, &picture);
    const double took =
        static_cast<double>(SDL_GetPerformanceCounter() - begun) / static_cast<double>(SDL_GetPerformanceFrequency());
    SDL_UnlockTexture(texture_.get());
    vsplat::check(status);
    seconds_ = by == smaller_ ? took : seconds_;
    sharp_ = by == 1, stale_ = false;
    draw_texture();
    SDL_RenderPresent(renderer_.get());
    char title[80];
    std::snprintf(title, sizeof title, "%d x %d, %.0f ms", width, height, 1e3 * took);
    SDL_SetWindowTitle(window_.get(), title);
  }

  void draw_texture() { need(SDL_RenderCopy(renderer_.get(), texture_.get(), nullptr, nullptr) == 0); }

  vsplat::Device device_{VSPLAT_DEVICE_OPTIONS_INIT};
  vsplat::Scene scene_;
  Orbit orbit_;
  int frames_;
  Window window_;
  Renderer renderer_;
  Texture texture_;
  int width_ = 0, height_ = 0, smaller_ = 1;
  double seconds_ = 0;  // time of a frame while something moves
  bool quit_ = false, moving_ = false, turning_ = false;
  bool sharp_ = false, stale_ = true;  // sharp_: the window shows full size; stale_: the view has changed since
};

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 2 || argc > 4) {
    std::fprintf(stderr, "usage: %s SCENE.ply [FRAMES [PICTURE.png]]\n", argv[0]);
    return 2;
  }
  const int frames = argc > 2 ? std::atoi(argv[2]) : 0;
  if (argc > 2 && frames < 1) {
    std::fprintf(stderr, "%s: FRAMES is %s: a number from 1 on expected\n", argv[0], argv[2]);
    return 2;
  }
  need(SDL_Init(SDL_INIT_VIDEO) == 0);
  struct Quit {
    ~Quit() { SDL_Quit(); }
  } const quit;
  Viewer viewer(argv[1], frames);
  viewer.run();
  if (argc > 3) viewer.save(argv[3]);
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
