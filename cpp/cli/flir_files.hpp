// Radiometric JPEGs of FLIR cameras: the visible image, the raw counts or the temperatures in them.
#pragma once

#include <array>
#include <string>

#include "footage.hpp"
#include "xcalib/camera.hpp"

namespace xcalib::cli {

// What `#` behind a folder of such files may take.
inline constexpr std::array<const char*, 3> kRadiometricParts = {"visible", "thermal",
                                                                 "temperature"};

bool is_radiometric(const Path& file);

// The camera's own alignment of its images, as a rig. Throws InputError where there is none.
Rig radiometric_alignment(const Path& file);

class RadiometricFiles : public ImageFiles {
   public:
    RadiometricFiles(std::vector<Path> paths, std::string part)
        : ImageFiles(std::move(paths)), part_(std::move(part)) {}
    std::string where(int index) const override;

   private:
    Picture read(int index) override;

    std::string part_;
};

}  // namespace xcalib::cli
