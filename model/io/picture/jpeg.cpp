#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
// libjpeg's headers need those above, and the codes in jerror.h depend on the version that jpeglib.h sets.
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include <algorithm>
#include <cstring>
#include <utility>

#include "model/io/picture/exif.h"
#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// libjpeg reports cut-off and damaged data as warnings and fills in grey. Only warnings that leave the picture intact
// are ignored.
bool harmless(int code) {
  return code == JWRN_EXTRANEOUS_DATA || code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR ||
         code == JWRN_TOO_MUCH_DATA || code == JWRN_BOGUS_ICC;
}

// A progressive file may visit its 8 x 8 blocks any number of times, at a few bytes each. Encoders do so about ten
// times.
constexpr int most_scans = 100, usual_scans = 20;
constexpr double most_block_visits = 4e8;  // takes some seconds

// libjpeg reports errors by a jump to its last caller.
struct Problems {
  jpeg_error_mgr errors{};
  jmp_buf leave;
  char message[JMSG_LENGTH_MAX] = {};
  bool out_of_memory = false;

  jpeg_error_mgr* handler();
};

struct ScanLimit {
  jpeg_progress_mgr progress{};  // first member: libjpeg only knows this one
  int scans = most_scans;
};

[[noreturn]] void jpeg_problem(j_common_ptr common) {
  auto* p = static_cast<Problems*>(common->client_data);
  common->err->format_message(common, p->message);
  p->out_of_memory = common->err->msg_code == JERR_OUT_OF_MEMORY;
  longjmp(p->leave, 1);
}

void jpeg_warning(j_common_ptr common, int level) {
  if (level < 0 && !harmless(common->err->msg_code)) jpeg_problem(common);
}

void jpeg_print_nothing(j_common_ptr) {}

jpeg_error_mgr* Problems::handler() {
  jpeg_std_error(&errors);
  errors.error_exit = jpeg_problem;
  errors.emit_message = jpeg_warning;
  errors.output_message = jpeg_print_nothing;
  return &errors;
}

void jpeg_count_scans(j_common_ptr common) {
  const auto* limit = reinterpret_cast<ScanLimit*>(common->progress);
  if (reinterpret_cast<j_decompress_ptr>(common)->input_scan_number <= limit->scans) return;
  auto* p = static_cast<Problems*>(common->client_data);
  std::snprintf(p->message, sizeof p->message, "it has more than %d scans", limit->scans);
  longjmp(p->leave, 1);
}

struct Reader : Problems {
  jpeg_decompress_struct jpeg{};
  ScanLimit limit;

  Reader() {
    jpeg.err = handler();
    jpeg.client_data = static_cast<Problems*>(this);
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() { jpeg_destroy_decompress(&jpeg); }
};

struct Writer : Problems {
  jpeg_compress_struct jpeg{};
  unsigned char* data = nullptr;  // allocated by libjpeg with malloc
  unsigned long size = 0;

  Writer() {
    jpeg.err = handler();
    jpeg.client_data = static_cast<Problems*>(this);
  }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  ~Writer() {
    jpeg_destroy_compress(&jpeg);
    std::free(data);
  }
};

// libjpeg exits by longjmp, so objects with destructors live outside the functions that call it.
bool read_header(Reader& r, const FileBytes& file) {
  if (setjmp(r.leave)) return false;
  jpeg_create_decompress(&r.jpeg);
  jpeg_mem_src(&r.jpeg, file.data, file.size);
  jpeg_save_markers(&r.jpeg, JPEG_APP0 + 1, 0xffff);  // EXIF
  jpeg_read_header(&r.jpeg, TRUE);
  return true;
}

bool start(Reader& r) {
  if (setjmp(r.leave)) return false;
  r.limit.progress.progress_monitor = jpeg_count_scans;
  r.jpeg.progress = &r.limit.progress;
  r.jpeg.out_color_space = JCS_RGB;
  jpeg_start_decompress(&r.jpeg);
  return true;
}

bool read_row(Reader& r, unsigned char* row) {
  if (setjmp(r.leave)) return false;
  JSAMPROW rows[1] = {row};
  jpeg_read_scanlines(&r.jpeg, rows, 1);
  return true;
}

bool finish(Reader& r) {
  if (setjmp(r.leave)) return false;
  jpeg_finish_decompress(&r.jpeg);
  return true;
}

bool write_all(Writer& w, int width, int height, int quality, const unsigned char* rgb) {
  if (setjmp(w.leave)) return false;
  jpeg_create_compress(&w.jpeg);
  jpeg_mem_dest(&w.jpeg, &w.data, &w.size);
  w.jpeg.image_width = static_cast<JDIMENSION>(width);
  w.jpeg.image_height = static_cast<JDIMENSION>(height);
  w.jpeg.input_components = 3;
  w.jpeg.in_color_space = JCS_RGB;
  jpeg_set_defaults(&w.jpeg);
  jpeg_set_quality(&w.jpeg, quality, TRUE);
  for (int i = 0; i < 3; ++i) w.jpeg.comp_info[i].h_samp_factor = w.jpeg.comp_info[i].v_samp_factor = 1;
  w.jpeg.optimize_coding = TRUE;
  jpeg_start_compress(&w.jpeg, TRUE);
  for (int y = 0; y < height; ++y) {
    JSAMPROW rows[1] = {const_cast<unsigned char*>(rgb) + static_cast<std::size_t>(y) * width * 3};  // only read
    jpeg_write_scanlines(&w.jpeg, rows, 1);
  }
  jpeg_finish_compress(&w.jpeg);
  return true;
}

[[noreturn]] void damaged(const FileBytes& file, const Reader& r) {
  if (r.out_of_memory) fail(Status::memory, "{}: not enough memory to decode the picture", file.path);
  fail(Status::format, "{}: a damaged or cut-off JPEG: {}", file.path, r.message);
}

void check_header(Reader& r, const FileBytes& file) {
  if (!read_header(r, file)) damaged(file, r);
  check_image_size(file.path, r.jpeg.image_width, r.jpeg.image_height);
}

ExifFacts exif_of(const Reader& r) {
  constexpr char name[] = "Exif\0";  // plus the terminating zero
  for (const jpeg_marker_struct* m = r.jpeg.marker_list; m; m = m->next)
    if (m->marker == JPEG_APP0 + 1 && m->data_length > sizeof name && std::memcmp(m->data, name, sizeof name) == 0)
      return read_exif(m->data + sizeof name, m->data_length - sizeof name);
  return {};
}

double blocks_of(const Reader& r) {
  double sum = 0;
  for (int c = 0; c < r.jpeg.num_components; ++c)
    sum += static_cast<double>(r.jpeg.comp_info[c].width_in_blocks) * r.jpeg.comp_info[c].height_in_blocks;
  return sum;
}

ImageInfo info_of(Reader& r) {
  const ExifFacts exif = exif_of(r);
  return {static_cast<int>(r.jpeg.image_width),
          static_cast<int>(r.jpeg.image_height),
          false,
          exif.orientation,
          jpeg_has_multiple_scans(&r.jpeg) ? blocks_of(r) * sizeof(JBLOCK) : 0,
          exif.lens};
}

class JpegRows : public FileRows {
 public:
  // `reader` has already read the header.
  JpegRows(const FileBytes& file, std::unique_ptr<Reader> reader)
      : FileRows(info_of(*reader), 8), file_(file), reader_(std::move(reader)) {
    Reader& r = *reader_;
    const double blocks = blocks_of(r);
    if (blocks / 8 > static_cast<double>(file.size))  // each takes at least one bit
      fail(Status::format, "{}: a damaged or cut-off JPEG: {} bytes cannot hold its {} x {} pixels", file.path,
           file.size, width, height);
    r.limit.scans = std::clamp(static_cast<int>(most_block_visits / blocks), usual_scans, most_scans);
    held_ = memory_to_decode(file, info_of(r));
    if (!start(r)) damaged(file_, r);
    row_.resize(row_size());
  }

  void next(float* out) override {
    if (!read_row(*reader_, row_.data())) damaged(file_, *reader_);
    for (const unsigned char v : row_) *out++ = static_cast<float>(v) / 255.0f;
    if (++at_ == height && !finish(*reader_)) damaged(file_, *reader_);
  }

 private:
  const FileBytes file_;
  std::unique_ptr<Reader> reader_;
  int at_ = 0;
  std::vector<unsigned char> row_;
  DecodingMemory held_;
};

}  // namespace

bool is_jpeg(const FileBytes& file) {
  return file.size >= 3 && file.data[0] == 0xff && file.data[1] == 0xd8 && file.data[2] == 0xff;
}

ImageInfo jpeg_info(const FileBytes& file) {
  Reader r;
  check_header(r, file);
  return info_of(r);
}

std::unique_ptr<FileRows> open_jpeg(const FileBytes& file) {
  auto reader = std::make_unique<Reader>();
  check_header(*reader, file);
  const J_COLOR_SPACE space = reader->jpeg.jpeg_color_space;
  if (space == JCS_CMYK || space == JCS_YCCK)
    fail(Status::format, "{}: a CMYK JPEG; only grey and RGB are read: convert it", file.path);
  if (space != JCS_GRAYSCALE && space != JCS_YCbCr && space != JCS_RGB)
    fail(Status::format, "{}: a JPEG of {} components in an unknown colour space; only grey and RGB are read",
         file.path, reader->jpeg.num_components);
  return std::make_unique<JpegRows>(file, std::move(reader));
}

std::vector<unsigned char> encode_jpeg(const std::string& path, const Image& image, int quality) {
  if (quality < 1 || quality > 100) fail(Status::usage, "{}: JPEG quality {}; 1 to 100 are possible", path, quality);
  if (image.channels != 3 || image.empty())
    fail(Status::internal, "write_jpeg takes 3 channels, not {} x {} x {}", image.width, image.height, image.channels);
  if (image.width > JPEG_MAX_DIMENSION || image.height > JPEG_MAX_DIMENSION)
    fail(Status::input, "{}: {} x {} pixels; JPEG holds at most {} to a side", path, image.width, image.height,
         JPEG_MAX_DIMENSION);
  const std::vector<unsigned char> rgb = rounded(image);
  Writer w;
  if (!write_all(w, image.width, image.height, quality, rgb.data()))
    fail(w.out_of_memory ? Status::memory : Status::internal, "{}: JPEG encoding failed: {}", path, w.message);
  return {w.data, w.data + w.size};
}

}  // namespace vsplat
