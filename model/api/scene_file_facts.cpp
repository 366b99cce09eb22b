// What a scene file says about itself.
#include "model/io/scene/scene_file_facts.h"

#include <algorithm>

#include "model/api/handle.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

template <std::size_t Size>
void copy_text(const std::string& from, char (&to)[Size]) {
  const std::size_t length = std::min(from.size(), Size - 1);
  std::copy_n(from.begin(), length, to);
  to[length] = '\0';
}

}  // namespace

vsplat_status vsplat_scene_file_describe(const char* path, vsplat_scene_file* out_file) {
  return guarded([&] {
    need(path, "path");
    require_output(out_file, "out_file");
    const SceneFileFacts facts = facts_of_scene_file(path);
    vsplat_scene_file out = VSPLAT_SCENE_FILE_INIT;
    out.format = facts.format->name.data();  // literals, which end with NUL
    out.title = facts.format->title.data();
    copy_text(facts.version, out.version);
    copy_text(facts.axes, out.axes);
    out.bytes = facts.bytes;
    give(out_file, out, "out_file");
  });
}
