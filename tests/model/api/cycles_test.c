/* Creates and releases a device, a stream of it, a scene and a job repeatedly: no memory, files or threads may be
   left. `cycles_test [CYCLES]`: default 500, of which the first fifth warms up. */
#include <dirent.h>
#include <stdlib.h>
#include <unistd.h>

enum { EDGE = 32, PIXELS = EDGE * EDGE, count = 200 };

#include "ball_scene.h"

typedef struct held {
  double mib;
  int files, threads;
} held;

static int entries_of(const char* folder) {
  DIR* dir = opendir(folder);
  int out = 0;
  while (dir && readdir(dir)) ++out;
  if (dir) closedir(dir);
  return out;
}

static held held_now(void) {
  held out = {0, 0, 0};
  long pages = 0, resident = 0;
  FILE* file = fopen("/proc/self/statm", "r");
  if (file && fscanf(file, "%ld %ld", &pages, &resident) == 2)
    out.mib = (double)resident * (double)sysconf(_SC_PAGESIZE) / (1 << 20);
  if (file) fclose(file);
  out.files = entries_of("/proc/self/fd");
  out.threads = entries_of("/proc/self/task");
  return out;
}

/* Returns the sum of the picture's values. */
static double cycle(void) {
  static float alpha[PIXELS];
  vsplat_device device = NULL, stream = NULL;
  vsplat_scene scene = make_scene(0);
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  vsplat_job job = NULL;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  double sum = 0;
  int i;
  camera.width = camera.height = EDGE;
  camera.fx = camera.fy = 1.25 * EDGE;
  camera.cx = camera.cy = EDGE / 2.0;
  camera.w2c[11] = 2;
  picture.capacity = PIXELS;
  picture.alpha = alpha;
  for (i = 0; i < PIXELS; ++i) alpha[i] = -1;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, vsplat_stream_create(device, &stream));
  EXPECT(VSPLAT_OK, vsplat_render_async(stream, scene, &camera, 1, NULL, &picture, NULL, &job));
  EXPECT(VSPLAT_OK, vsplat_job_wait(job, -1, &state));
  HOLD(state == VSPLAT_JOB_DONE);
  vsplat_job_release(job);
  vsplat_scene_release(scene);
  vsplat_device_release(stream);
  vsplat_device_release(device);
  for (i = 0; i < PIXELS; ++i) sum += (double)alpha[i];
  return sum;
}

int main(int argc, char** argv) {
  const int cycles = argc > 1 ? atoi(argv[1]) : 500, warm = cycles / 5;
  held before = {0, 0, 0}, after;
  double drawn = 0;
  int i;
  for (i = 0; i < cycles && failures == 0; ++i) {
    const double sum = cycle();
    if (i == 0) drawn = sum;
    HOLD(sum == drawn && sum > 1);
    if (i + 1 == warm) before = held_now();
  }
  after = held_now();
  printf("%d cycles: %.1f MiB, %d files, %d threads after %d of them, %.1f MiB, %d, %d at the end\n", cycles,
         before.mib, before.files, before.threads, warm, after.mib, after.files, after.threads);
  HOLD(after.mib < before.mib + 0.02 * (cycles - warm)); /* 20 KiB per cycle would be a significant leak */
  HOLD(after.files <= before.files);
  HOLD(after.threads <= before.threads);
  return failures != 0;
}
