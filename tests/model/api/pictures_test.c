/* Camera paths, contact sheets, animations and comparisons through the C interface, without a device. Prints every
   check that fails; exits 1 if any did. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <vsplat/pictures.h>

#include "checks.h"

enum { width = 24, height = 16, floats = width * height * 3 };

static float colour[floats];
static vsplat_picture picture = VSPLAT_PICTURE_INIT;

static long file_size(const char* path) {
  long size;
  FILE* file = fopen(path, "rb");
  if (!file) return -1;
  fseek(file, 0, SEEK_END);
  size = ftell(file);
  fclose(file);
  return size;
}

static void put(const char* path, const char* text) {
  FILE* file = fopen(path, "wb");
  if (!file || fputs(text, file) < 0 || fclose(file) != 0) HOLD(!"a file can be written");
}

/* Two cameras with pictures a.png and (without a name) 0001.png; the second is rotated by 90 degrees about y. */
static vsplat_cameras load_keys(void) {
  vsplat_cameras out = NULL;
  put("cameras.json",
      "[{\"file\": \"shots/a.png\", \"w\": 24, \"h\": 16, \"fx\": 20, \"fy\": 25, \"cx\": 11, \"cy\": 9,"
      "  \"w2c\": [[1,0,0,0],[0,1,0,0],[0,0,1,2],[0,0,0,1]]},"
      " {\"file\": \"\", \"w\": 24, \"h\": 16, \"fx\": 20, \"fy\": 25, \"cx\": 13, \"cy\": 9,"
      "  \"w2c\": [[0,0,1,0],[0,1,0,0],[-1,0,0,2],[0,0,0,1]]}]");
  EXPECT(VSPLAT_OK, vsplat_cameras_load("cameras.json", 0, 0, &out));
  return out;
}

static void paths(void) {
  vsplat_cameras keys = load_keys(), path = NULL;
  vsplat_camera first = VSPLAT_CAMERA_INIT, middle = VSPLAT_CAMERA_INIT;
  size_t count = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_path(keys, 0, &path));
  EXPECT(VSPLAT_OK, vsplat_cameras_path(keys, 3, &path));
  EXPECT(VSPLAT_OK, vsplat_cameras_count(path, &count));
  HOLD(count == 3);
  EXPECT(VSPLAT_OK, vsplat_cameras_get(path, 0, &first));
  EXPECT(VSPLAT_OK, vsplat_cameras_get(path, 1, &middle));
  HOLD(first.w2c[11] == 2 && first.cx == 11 && first.width == width);
  HOLD(fabs(middle.w2c[0] - sqrt(0.5)) < 1e-12 && fabs(middle.w2c[2] - sqrt(0.5)) < 1e-12);
  HOLD(fabs(middle.cx - 12) < 1e-12 && middle.height == height);
  vsplat_cameras_release(keys);
  vsplat_cameras_release(path);
}

static void cameras_saved(void) {
  vsplat_camera cameras[2] = {VSPLAT_CAMERA_INIT, VSPLAT_CAMERA_INIT}, again = VSPLAT_CAMERA_INIT;
  const char* names[2] = {"shots/a.png", "shots/b.png"};
  vsplat_cameras loaded = NULL;
  int i;
  for (i = 0; i < 2; ++i) {
    cameras[i].width = 24;
    cameras[i].height = 16;
    cameras[i].fx = 20.1;
    cameras[i].fy = 25 + i;
    cameras[i].w2c[11] = 1.0 / 3;
  }
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_save(cameras, 0, NULL, "saved.json"));
  cameras[1].fy = -1;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_cameras_save(cameras, 2, NULL, "saved.json"));
  HOLD(file_size("saved.json") == -1);
  cameras[1].fy = 26;
  EXPECT(VSPLAT_OK, vsplat_cameras_save(cameras, 2, names, "saved.json"));
  EXPECT(VSPLAT_OK, vsplat_cameras_load("saved.json", 0, 0, &loaded));
  EXPECT(VSPLAT_OK, vsplat_cameras_get(loaded, 1, &again));
  HOLD(again.fx == 20.1 && again.fy == 26 && again.w2c[11] == 1.0 / 3 && again.width == 24);
  vsplat_cameras_release(loaded);
}

static void pictures_with_alpha(void) {
  float half[floats / 3], none[floats / 3];
  int i;
  vsplat_picture p = VSPLAT_PICTURE_INIT;
  for (i = 0; i < floats / 3; ++i) half[i] = 0.5f, none[i] = 0;
  p.capacity = floats / 3;
  p.colour = colour;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_picture_save(&p, width, height, VSPLAT_PICTURE_PNG_ALPHA, "alpha.png"));
  p.alpha = half;
  EXPECT(VSPLAT_OK, vsplat_picture_save(&p, width, height, VSPLAT_PICTURE_PNG_ALPHA, "alpha.png"));
  HOLD(file_size("alpha.png") > 50);
  p.alpha = none;
  EXPECT(VSPLAT_OK, vsplat_picture_save(&p, width, height, VSPLAT_PICTURE_PNG_ALPHA, "alpha.png"));
}

static void sheets(void) {
  vsplat_sheet sheet = NULL;
  vsplat_sheet_options options = VSPLAT_SHEET_OPTIONS_INIT;
  int32_t w = 0, h = 0;
  options.cell = -1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_sheet_create(&options, &sheet));
  options.cell = 12;
  options.columns = 2;
  EXPECT(VSPLAT_OK, vsplat_sheet_create(&options, &sheet));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_sheet_save(sheet, "sheet.png")); /* it is empty */
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_sheet_add(sheet, &picture, width, height + 1));
  EXPECT(VSPLAT_OK, vsplat_sheet_add(sheet, &picture, width, height));
  EXPECT(VSPLAT_OK, vsplat_sheet_add(sheet, &picture, height, width));
  EXPECT(VSPLAT_OK, vsplat_sheet_add(sheet, &picture, 1, 1));
  HOLD(file_size("sheet.png") == -1);
  EXPECT(VSPLAT_ERROR_FILE, vsplat_sheet_save(sheet, "no/such/folder.png"));
  EXPECT(VSPLAT_OK, vsplat_sheet_save(sheet, "sheet.png"));
  EXPECT(VSPLAT_OK, vsplat_picture_file_size("sheet.png", &w, &h));
  HOLD(w == 2 * 12 + 3 * 8 && h == 2 * 12 + 3 * 8);
  char* lens = NULL;
  EXPECT(VSPLAT_OK, vsplat_picture_file_lens("sheet.png", &lens));
  HOLD(strcmp(lens, "") == 0);
  vsplat_text_free(lens);
  EXPECT(VSPLAT_OK, vsplat_sheet_add_labelled(sheet, &picture, width, height, "a"));
  EXPECT(VSPLAT_OK, vsplat_sheet_add_labelled(sheet, &picture, width, height, NULL));
  EXPECT(VSPLAT_OK, vsplat_sheet_save(sheet, "sheet.png"));
  EXPECT(VSPLAT_OK, vsplat_picture_file_size("sheet.png", &w, &h));
  HOLD(h == 3 * (12 + 12) + 4 * 8);
  vsplat_sheet_retain(sheet);
  vsplat_sheet_release(sheet);
  vsplat_sheet_release(sheet);
}

static void animations(void) {
  vsplat_animation animation = NULL;
  vsplat_animation_options options = VSPLAT_ANIMATION_OPTIONS_INIT;
  options.fps = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_animation_create(&options, &animation));
  options.fps = 10;
  options.quality = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_animation_create(&options, &animation));
  options.quality = 90;
  options.format = 2;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_animation_create(&options, &animation));
  HOLD(!animation);
  EXPECT(VSPLAT_OK, vsplat_animation_create(NULL, &animation));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_animation_save(animation, "film.webp"));
  EXPECT(VSPLAT_OK, vsplat_animation_add(animation, &picture, width, height));
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_animation_add(animation, &picture, height, width));
  HOLD(file_size("film.webp") == -1);
  EXPECT(VSPLAT_OK, vsplat_animation_save(animation, "film.webp"));
  HOLD(file_size("film.webp") > 50);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_animation_add(animation, &picture, width, height));
  EXPECT(VSPLAT_OK, vsplat_animation_save(animation, "again.webp"));
  HOLD(file_size("again.webp") == file_size("film.webp"));
  vsplat_animation_release(animation);
  animation = NULL;
  options.format = VSPLAT_ANIMATION_GIF;
  if (vsplat_animation_create(&options, &animation) != VSPLAT_OK) { /* a build without giflib */
    HOLD(strstr(vsplat_last_error(), "GIF") != NULL);
    return;
  }
  EXPECT(VSPLAT_OK, vsplat_animation_add(animation, &picture, width, height));
  EXPECT(VSPLAT_OK, vsplat_animation_save(animation, "film.gif"));
  HOLD(file_size("film.gif") > 50);
  vsplat_animation_release(animation);
}

static void comparisons(void) {
  static float loaded[floats], difference[floats];
  const float background[3] = {0, 0, 0};
  vsplat_cameras keys = load_keys();
  vsplat_comparison found = VSPLAT_COMPARISON_INIT;
  char *path = NULL, *none = NULL;
  int i;
  EXPECT(VSPLAT_OK, vsplat_picture_save_jpeg(&picture, width, height, 100, "a.jpg"));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_picture_save_jpeg(&picture, width, height, 0, "b.jpg"));
  EXPECT(VSPLAT_OK, vsplat_picture_save(&picture, width, height, VSPLAT_PICTURE_JPEG, "b.jpg"));
  HOLD(file_size("b.jpg") > 0 && file_size("b.jpg") < file_size("a.jpg"));
  EXPECT(VSPLAT_OK, vsplat_picture_save(&picture, width, height, VSPLAT_PICTURE_PNG, "0001.png"));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_find_picture(keys, 2, ".", &path));
  EXPECT(VSPLAT_ERROR_FILE, vsplat_cameras_find_picture(keys, 0, "nowhere", &path));
  HOLD(!path);
  EXPECT(VSPLAT_OK, vsplat_cameras_find_picture(keys, 0, ".", &path));
  HOLD(path && strcmp(path, "./a.jpg") == 0);
  vsplat_text_free(path);
  EXPECT(VSPLAT_OK, vsplat_cameras_find_picture(keys, 1, ".", &path));
  HOLD(path && strcmp(path, "./0001.png") == 0);
  EXPECT(VSPLAT_OK, vsplat_cameras_find_picture(keys, 0, NULL, &none)); /* the list was read before a.jpg was there */
  HOLD(none && strcmp(none, "") == 0);
  vsplat_text_free(none);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_find_picture(keys, 2, NULL, &none));
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_cameras_load_picture(keys, 1, path, height, width, background, loaded, floats));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_load_picture(keys, 1, path, width, height, background, loaded, floats - 1));
  EXPECT(VSPLAT_OK, vsplat_cameras_load_picture(keys, 1, path, width, height, background, loaded, floats));
  vsplat_text_free(path);
  for (i = 0; i < floats && fabsf(loaded[i] - colour[i]) < 0.002f; ++i) continue;
  HOLD(i == floats);
  EXPECT(VSPLAT_OK, vsplat_compare(colour, loaded, width, height, &found, difference));
  HOLD(found.psnr > 50 && found.ssim > 0.99 && found.ssim <= 1 && found.psnr_cc >= found.psnr);
  for (i = 0; i < floats && difference[i] == fabsf(loaded[i] - colour[i]); ++i) continue;
  HOLD(i == floats);
  EXPECT(VSPLAT_OK, vsplat_compare(colour, colour, width, height, &found, NULL));
  HOLD(isinf(found.psnr) && found.psnr > 0 && fabs(found.ssim - 1) < 1e-12);
  EXPECT(VSPLAT_OK, vsplat_compare(colour, colour, 4, 4, &found, NULL)); /* smaller than a window */
  HOLD(isnan(found.ssim));
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_compare(colour, colour, 0, 4, &found, NULL));
  remove("a.jpg");
  EXPECT(VSPLAT_OK, vsplat_cameras_find_picture(keys, 0, ".", &none));
  HOLD(none && strcmp(none, "") == 0);
  vsplat_text_free(none);
  vsplat_cameras_release(keys);
}

int main(void) {
  char folder[] = "/tmp/vsplat-pictures-XXXXXX";
  const char* const left[] = {"cameras.json", "sheet.png", "film.webp",  "again.webp", "film.gif",
                              "b.jpg",        "0001.png",  "saved.json", "alpha.png"};
  size_t i;
  for (i = 0; i < floats; ++i) colour[i] = 0.5f + 0.4f * sinf((float)(i / 3) * 0.05f + (float)(i % 3));
  picture.capacity = width * height;
  picture.colour = colour;
  if (!mkdtemp(folder) || chdir(folder) != 0) return 1;
  paths();
  cameras_saved();
  pictures_with_alpha();
  sheets();
  animations();
  comparisons();
  for (i = 0; i < sizeof left / sizeof *left; ++i) HOLD(remove(left[i]) == 0);
  HOLD(rmdir(folder) == 0);
  if (failures) printf("%d checks do not hold\n", failures);
  return failures != 0;
}
