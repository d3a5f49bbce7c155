// SPDX-License-Identifier: Apache-2.0
#include "base/misnamed_file.h"

#include <unistd.h>

#include <algorithm>
#include <array>

#include "base/error_kinds.h"
#include "base/text.h"

namespace lenticule {
namespace {

constexpr MisnamedFile kUsd{"a scene in USD", "convert it to glTF, for example in Blender"};
constexpr MisnamedFile kBlender{"a scene of Blender", "export it from Blender as glTF"};
constexpr MisnamedFile kSplats{"Gaussian splats, which have no surfaces",
                               "convert it to a mesh, or render it to a quilt elsewhere"};
constexpr MisnamedFile kPicture{"a picture, not what its name says", "rename it: .png or .jpg"};
constexpr MisnamedFile kPage{"a page of the web, not the file",
                             "download the file itself, for example by its button 'raw'"};

struct Sign {
  std::string_view text;  ///< the first bytes, or an extension, in lower case
  MisnamedFile is;
};
constexpr std::array<Sign, 16> kSigns{{
    {"version https://git-lfs", {"a pointer of Git LFS, not the file", "run: git lfs pull"}},
    {"\x89lts", {"a film of lenticule, not what its name says", "rename it: .lts"}},
    {"\x89png", kPicture},
    {"\xff\xd8\xff", kPicture},
    {"<!doctype html", kPage},
    {"<html", kPage},
    {"blender", kBlender},
    {"#usda", kUsd},
    {"pxr-usdc", kUsd},
    {".usd", kUsd},
    {".usdz", kUsd},
    {".splat", kSplats},
    {".ksplat", kSplats},
    {".spz", kSplats},
    {".max", {"a scene of 3ds Max", "export it as glTF"}},
    {".ma", {"a scene of Maya", "export it as glTF"}},
}};

}  // namespace

std::optional<MisnamedFile> recognise_misnamed(std::string_view head, std::string_view extension) {
  head.remove_prefix(std::min(head.find_first_not_of(" \t\r\n"), head.size()));
  const std::string begin = lower_case(std::string(head.substr(0, 64)));
  const bool is_named_so =
      extension == ".png" || extension == ".jpg" || extension == ".jpeg" || extension == ".lts";
  const auto* const found = std::ranges::find_if(kSigns, [&](const Sign& sign) {
    return (begin.starts_with(sign.text) &&
            !(is_named_so && sign.is.remedy.starts_with("rename"))) ||
           extension == sign.text;
  });
  return found == kSigns.end() ? std::nullopt : std::optional(found->is);
}

void refuse_misnamed(int file, const std::string& name) {
  std::array<char, 64> bytes{};
  const ssize_t n = ::pread(file, bytes.data(), bytes.size(), 0);
  const std::string_view head(bytes.data(), static_cast<size_t>(std::max<ssize_t>(n, 0)));
  auto is = head.empty() ? MisnamedFile{"empty", "copy it anew"} : recognise_misnamed(head, {});
  const auto is_control = [](char c) { return c >= '\0' && c < '\t'; };
  if (!is && !head.empty() && std::ranges::none_of(head, is_control))
    is = {"a text, not the file", kPage.remedy};
  if (is) throw input_error("{}: {}", name, is->what).remedy(std::string(is->remedy));
}

}  // namespace lenticule
