// The formats of scene files, and saving scenes in one of them.
#include "model/io/scene/scene_format.h"

#include "model/api/scene.h"
#include "model/io/scene/offset_file.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

struct Saving {
  const SceneFormat* format;
  SceneWriteOptions options;
};

// `format` if the options name none.
Saving saving_of(const vsplat_scene_save_options* given, const SceneFormat& (*otherwise)(const std::string& path),
                 const std::string& path) {
  const vsplat_scene_save_options o = taken(given, VSPLAT_SCENE_SAVE_OPTIONS_INIT, "options");
  Saving out{&(o.format ? scene_format(o.format) : otherwise(path)), {}};
  if (o.spz_version != 0 && (o.spz_version < 2 || o.spz_version > 4))
    fail(Status::usage, "options.spz_version is {}: 2 to 4, or 0, is expected", o.spz_version);
  if (o.spz_version != 0) out.options.spz_version = o.spz_version;
  if (!out.format->write) fail(Status::usage, "options.format: {} is read, but not written", out.format->title);
  return out;
}

}  // namespace

size_t vsplat_scene_format_count(void) { return scene_formats().size(); }

vsplat_status vsplat_scene_format_get(size_t index, vsplat_scene_format* out_format) {
  return guarded([&] {
    const std::span<const SceneFormat> all = scene_formats();
    if (index >= all.size()) fail(Status::usage, "index is {}: there are {} formats", index, all.size());
    const SceneFormat& f = all[index];
    vsplat_scene_format out = VSPLAT_SCENE_FORMAT_INIT;
    // The table's texts are literals, which end with NUL.
    out.name = f.name.data();
    out.title = f.title.data();
    out.endings = f.endings.data();
    out.reads = f.read != nullptr;
    out.writes = f.write != nullptr;
    out.sh_degree = f.sh_written;
    out.lossless = f.lossless;
    out.lost = f.lost.data();
    out.opened_by = f.opened_by.data();
    give(out_format, out, "out_format");
  });
}

vsplat_status vsplat_scene_save(vsplat_scene scene, const char* path) {
  return vsplat_scene_save_with(scene, path, nullptr);
}

vsplat_status vsplat_scene_save_with(vsplat_scene scene, const char* path, const vsplat_scene_save_options* options) {
  return guarded([&] {
    need(scene, "scene");
    need(path, "path");
    const Saving how = saving_of(options, written_format, path);
    const std::shared_ptr<const Scene> now = scene->now();
    how.format->write(path, *now, how.options);
    write_offset_file(path, *now);  // an older scene that stays keeps its own
  });
}

vsplat_status vsplat_scene_save_memory(vsplat_scene scene, char** out_bytes, size_t* out_size) {
  return vsplat_scene_save_memory_with(scene, nullptr, out_bytes, out_size);
}

vsplat_status vsplat_scene_save_memory_with(vsplat_scene scene, const vsplat_scene_save_options* options,
                                            char** out_bytes, size_t* out_size) {
  return guarded([&] {
    need(scene, "scene");
    const auto plain = [](const std::string&) -> const SceneFormat& { return scene_format("ply"); };
    const Saving how = saving_of(options, plain, "");
    const std::shared_ptr<const Scene> now = scene->now();
    give_bytes([&](const std::string& name) { how.format->write(name, *now, how.options); }, "the scene", out_bytes,
               out_size);
  });
}

vsplat_status vsplat_scene_get_losses(vsplat_scene scene, const char* format, char** out_text) {
  return guarded([&] {
    need(scene, "scene");
    need(format, "format");
    need(out_text, "out_text");
    std::string text;
    for (const std::string& sentence : losses(scene_format(format), *scene->now())) text += sentence + "\n";
    *out_text = new_text(text);
  });
}
