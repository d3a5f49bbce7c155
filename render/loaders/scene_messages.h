// SPDX-License-Identifier: Apache-2.0
// The messages between a command and `lenticule-reader`, each one packet of a socket. Both programs
// come from the same build; the command checks all values that it receives.
//
//   command              reader
//                        Ready             once, when it is confined
//   Load, path, up, choices
//                        Find, path, name  zero or more of these three, in any order
//   Answer, path
//                        Open, path
//   Answer, bytes        with the file's descriptor, or Failed
//                        Texture           with a socket of its own, on which a message waits that
//   Answer, number       asks for the texture: a path, or a descriptor with `bytes` bytes
//                        Piece, bytes      of the archive, in one half of the memory
//   Answer
//                        Done              or Failed, instead of anything
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "frames/picture_codec.h"

namespace lenticule::render::confined {

/// Descriptors of the reader: the socket, and the memory that both processes share.
inline constexpr int kSocket = 0;
inline constexpr int kMemory = 3;

/// The memory has two halves, which carry pieces of the archive alternately. They fit into the
/// caches of a processor.
inline constexpr size_t kHalfBytes = size_t{1} << 20;
inline constexpr size_t kMemoryBytes = 2 * kHalfBytes;

enum class Word : uint32_t { Ready, Load, Find, Open, Texture, Piece, Answer, Done, Failed };

struct Message {
  Word word = Word::Ready;
  int32_t up = -1;  ///< UpAxis of Load, or -1
  frames::PictureValues values = frames::PictureValues::Colours;
  frames::TexelPlace place = frames::TexelPlace::Here;
  int32_t width = 0, height = 0;  ///< size of the texture
  int32_t reduced = 1;            ///< as TextureImage has it
  int32_t number = -1;            ///< number of the texels, if the command keeps them
  uint32_t pixel_bytes = 0;       ///< size of a texel in the descriptor
  uint64_t bytes = 0;             ///< size of the file in the descriptor, or of the piece
  std::array<char, 4096> path{};  ///< zero-terminated, as is the name
  std::array<char, 1024> name{};  ///< name in a scene, label of a texture, cause of a failure
  std::array<char, 512> hint{};   ///< remedy of a failure
  /// ViewerChoices of Load.
  std::array<char, 512> scene{}, animation{}, variant{};
};

}  // namespace lenticule::render::confined
