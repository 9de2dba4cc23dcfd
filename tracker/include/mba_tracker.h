/* Motion-blur-aware RGB-D tracker. Made by cbindgen from tracker/src/capi; do not edit.
 *
 * Every function returns MBA_OK or MBA_ERROR_*. Null and misaligned pointers, short buffers, wrong sizes, impossible
 * calibrations and memory without a tracker are refused. The caller sees to the rest:
 *
 *  - a pointer that is neither null nor misaligned points to as many valid bytes as its type or the stated size says;
 *  - inputs are only read, and only during the call; outputs are written only on MBA_OK and overlap no input;
 *  - the memory given to mba_tracker_init belongs to the tracker: it is not written, moved or copied while the tracker
 *    is in use. There is nothing to destroy;
 *  - what is given for a tracker has at least eight initialised bytes;
 *  - one thread at a time uses a tracker; different trackers are independent.
 */

#ifndef MBA_TRACKER_H
#define MBA_TRACKER_H

#include <stddef.h>
#include <stdint.h>

/* A tracker in the caller's memory. */
typedef struct MbaTracker MbaTracker;

// All is well.
#define MBA_OK 0

// A pointer that must not be null is null.
#define MBA_ERROR_NULL_POINTER 1

// A pointer does not have the alignment of what it points to, or the memory not that of `MBA_MEMORY_ALIGNMENT`.
#define MBA_ERROR_MISALIGNED 2

// Memory or an image is shorter than its size and stride say.
#define MBA_ERROR_SHORT_BUFFER 3

// An image does not have the configured size.
#define MBA_ERROR_IMAGE_SIZE 4

// A stride is shorter than a row, or that of a depth image odd.
#define MBA_ERROR_STRIDE 5

// A pixel format is none of `MBA_PIXEL_*`.
#define MBA_ERROR_PIXEL_FORMAT 6

// The calibration or a setting is outside its range or not a number.
#define MBA_ERROR_CONFIG 7

// A timestamp is not finite or not after that of the frame before.
#define MBA_ERROR_TIMESTAMP 8

// An exposure time is negative or not finite.
#define MBA_ERROR_EXPOSURE 9

// A pose is not finite or its quaternion not of unit length.
#define MBA_ERROR_POSE 10

// An angular velocity is not finite.
#define MBA_ERROR_ANGULAR_VELOCITY 11

// The memory does not hold a tracker.
#define MBA_ERROR_NOT_INITIALISED 12

// The time of a depth image is not finite or more than 0.2 s from that of its colour image.
#define MBA_ERROR_DEPTH_TIMESTAMP 13

// One byte per pixel.
#define MBA_PIXEL_GREY8 1

// Three bytes per pixel: red, green, blue.
#define MBA_PIXEL_RGB8 2

// The frame was aligned.
#define MBA_STATUS_OK 0

// Aligned, but with few measurements or large residuals.
#define MBA_STATUS_WEAK 1

// Not aligned: the pose is the last good one.
#define MBA_STATUS_LOST 2

// Keyframes are deblurred with their own motion.
#define MBA_REFERENCE_DEBLURRED 0

// Keyframes stay as captured; takes less memory.
#define MBA_REFERENCE_RAW 1

// As accurate as can be.
#define MBA_EFFORT_FULL 0

// At most 5 linearisations per level and 16 virtual views.
#define MBA_EFFORT_MEDIUM 1

// At most 3 linearisations per level and 8 virtual views.
#define MBA_EFFORT_LOW 2

// Alignment in bytes of the memory of a tracker.
#define MBA_MEMORY_ALIGNMENT 64

// Calibration and settings. Fill it with `mba_config_default` or `mba_config_compact`, then change what you need.
typedef struct {
  // Columns of the images, 32 to 8192.
  uint32_t width;
  // Rows of the images, 32 to 8192.
  uint32_t height;
  // Focal length along x in pixels.
  double fx;
  // Focal length along y in pixels.
  double fy;
  // Column of the principal point; the centre of the top-left pixel is (0, 0).
  double cx;
  // Row of the principal point.
  double cy;
  // Metres per raw unit of the depth images, e.g. 0.001.
  float metres_per_unit;
  // Pyramid levels, 2 to 6.
  uint32_t levels;
  // Pyramid level of the depth maps, less than `levels`.
  uint32_t surface_level;
  // Earlier keyframes that a lost tracker looks for, 0 to 4.
  uint32_t recent_keyframes;
  // Bands of rows that share their virtual views, 1 to 16; counts only where the readout is not 0.
  uint32_t row_bands;
  // 1 when depth images are taken at times of their own, `MbaFrame.depth_timestamp`; 0 when together with the colour images.
  uint32_t depth_apart;
  // Seconds from the first row of a colour image to the last, -0.1 to 0.1; 0 for a global shutter.
  double readout_seconds;
  // Seconds from the first row of a depth image to the last, -0.1 to 0.1.
  double depth_readout_seconds;
  // Light falls off as `1 + a2 r^2 + a4 r^4`, above 0, with `r` = 1 at the centre of a corner pixel; 0 and 0 for a lens
  // without fall-off.
  double vignetting_a2;
  // See `vignetting_a2`.
  double vignetting_a4;
  // `MBA_REFERENCE_*`.
  int32_t reference;
  // `MBA_EFFORT_*`.
  int32_t effort;
  // Linear light of the 256 byte values, finite, not negative, strictly increasing; null for sRGB. Read by
  // `mba_tracker_init` only.
  const float *response;
  // A clock in ticks of your choice, called before and after a frame; null for none.
  uint64_t (*clock)(void);
} MbaConfig;

// An 8-bit image, undistorted, encoded by the camera's response.
typedef struct {
  // First byte of the first row.
  const uint8_t *data;
  // Readable bytes from there.
  size_t size_bytes;
  // Columns.
  uint32_t width;
  // Rows.
  uint32_t height;
  // Bytes from one row to the next.
  uint32_t stride_bytes;
  // `MBA_PIXEL_*`.
  int32_t format;
} MbaImage;

// A 16-bit depth image registered to the colour image: z along the optical axis in raw units, 0 where unknown.
typedef struct {
  // First value of the first row, aligned to 2 bytes.
  const uint16_t *data;
  // Readable bytes from there.
  size_t size_bytes;
  // Columns.
  uint32_t width;
  // Rows.
  uint32_t height;
  // Bytes from one row to the next, even.
  uint32_t stride_bytes;
} MbaDepth;

// One RGB-D frame.
typedef struct {
  // Mid-exposure time in seconds; with rows that are exposed one after the other, of the middle row.
  double timestamp;
  // Exposure time in seconds, of every row.
  double exposure;
  // Time of the depth image's middle row in seconds; ignored unless the configuration says `depth_apart`.
  double depth_timestamp;
  // Colour or grey image.
  MbaImage image;
  // Depth image.
  MbaDepth depth;
  // Three values: mean angular velocity since the frame before, camera frame, rad/s; null without a gyroscope.
  const double *angular_velocity;
} MbaFrame;

// Maps camera coordinates (x right, y down, z forward) into the world: x_world = R x_camera + translation.
typedef struct {
  // R as a unit quaternion: x, y, z, w.
  double rotation[4];
  // Metres.
  double translation[3];
} MbaPose;

// What is known about a frame after tracking.
typedef struct {
  // Running number of the frame, from 0.
  uint64_t index;
  // Running number of the frame that it was aligned with.
  uint64_t reference_index;
  // Mid-exposure time, seconds.
  double timestamp;
  // `MBA_STATUS_*`.
  int32_t status;
  // 1 when the frame became the keyframe, else 0.
  int32_t is_keyframe;
  // Pose at shutter opening; the world is the first frame's camera at mid exposure.
  MbaPose world_from_camera_start;
  // Pose at shutter closing.
  MbaPose world_from_camera_end;
  // Covariance of the pose at mid exposure, row by row: translation in keyframe axes (m), rotation in the camera
  // (rad). Zero unless `has_covariance`.
  double covariance[36];
  // 1 when `covariance` holds values, else 0.
  int32_t has_covariance;
  // Linearisations on all levels: the work that the frame took.
  uint32_t iterations;
  // Mean blur length in pixels.
  float blur;
  // Share of the keyframe's patches that are in view and agree.
  float inliers;
  // Robust photometric residual in standard deviations of the nominal noise.
  float residual;
  // Virtual views on the finest level.
  uint32_t virtual_views;
  // Ticks of the configured clock that the frame took; 0 without a clock.
  uint64_t ticks;
} MbaResult;





#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library: major << 16 | minor << 8 | patch.
uint32_t mba_version(void);

// What a returned code means; never null, valid for ever.
const char *mba_error_string(int32_t code);

// Name of a frame's status; never null, valid for ever.
const char *mba_status_string(int32_t status);

// Fills `config` with a calibration and the most accurate settings. The calibration is not checked yet.
//
// # Safety
// `config`: null, misaligned, or writable for one `MbaConfig`.
int32_t mba_config_default(MbaConfig *config,
                           uint32_t width,
                           uint32_t height,
                           double fx,
                           double fy,
                           double cx,
                           double cy,
                           float metres_per_unit);

// Fills `config` with a calibration and settings for devices with little memory. The calibration is not checked yet.
//
// # Safety
// `config`: null, misaligned, or writable for one `MbaConfig`.
int32_t mba_config_compact(MbaConfig *config,
                           uint32_t width,
                           uint32_t height,
                           double fx,
                           double fy,
                           double cx,
                           double cy,
                           float metres_per_unit);

// Writes to `bytes` how much memory `mba_tracker_init` needs, aligned to `MBA_MEMORY_ALIGNMENT`.
//
// # Safety
// `config`: null, misaligned, or one `MbaConfig` whose response is null or has 256 values. `bytes`: null, misaligned, or
// writable.
int32_t mba_memory_size(const MbaConfig *config,
                        size_t *bytes);

// Builds a tracker in `memory` and writes its handle, which points into `memory`, to `tracker`. There is nothing to
// free: the memory is the caller's.
//
// # Safety
// `memory`: null, misaligned, or `memory_bytes` writable bytes that nothing else uses from now on. `config`: null,
// misaligned, or one `MbaConfig` whose response is null or has 256 values. `tracker`: null, misaligned, or writable.
int32_t mba_tracker_init(void *memory,
                         size_t memory_bytes,
                         const MbaConfig *config,
                         MbaTracker **tracker);

// Tracks one frame and writes what was found to `result`. A frame that is refused leaves the tracker as it was.
//
// # Safety
// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. `frame`: null, misaligned,
// or one `MbaFrame` whose images have as many bytes as they say and whose angular velocity is null or has three values.
// `result`: null, misaligned, or writable.
int32_t mba_track(MbaTracker *tracker,
                  const MbaFrame *frame,
                  MbaResult *result);

// Replaces the keyframe by a sharp view from outside, for example rendered from a map; its pose is in the tracker's
// world. Tracking starts from it if no frame was tracked yet.
//
// # Safety
// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. The others: null,
// misaligned, or one value each, and images have as many bytes as they say.
int32_t mba_set_reference(MbaTracker *tracker,
                          const MbaImage *image,
                          const MbaDepth *depth,
                          const MbaPose *world_from_camera);

// Replaces the keyframe as `mba_set_reference` does and goes on near `world_from_camera`, wherever the camera was thought
// to be before: for a lost tracker whose place was recognised. `world_from_view` is the pose of the images. How the
// camera moves is unknown until the next frame. When anything is refused the tracker stays as it was.
//
// # Safety
// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. The others: null,
// misaligned, or one value each, and images have as many bytes as they say.
int32_t mba_relocate(MbaTracker *tracker,
                     const MbaImage *image,
                     const MbaDepth *depth,
                     const MbaPose *world_from_view,
                     const MbaPose *world_from_camera);

// Moves all that the tracker remembers into another world, as a loop closure does: `new_world_from_world` maps points of
// the world so far into the new one, in which later poses are. Nothing else changes.
//
// # Safety
// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile. `new_world_from_world`:
// null, misaligned, or one `MbaPose`.
int32_t mba_move_world(MbaTracker *tracker,
                       const MbaPose *new_world_from_world);

// Forgets everything but the configuration; the next frame starts a new world.
//
// # Safety
// `tracker`: null, misaligned, or the handle of a tracker that no other thread uses meanwhile.
int32_t mba_reset(MbaTracker *tracker);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MBA_TRACKER_H */
