// What the pixels of a row hide from each other, where epipolar lines run nearly along rows. Along
// the row, points of one surface lie one behind the other in the source; what is nearer than its
// surroundings comes back over them, or is passed by them. Only such vectors are looked at: those
// that hide are written to one row of cells, in an order in which the nearest comes last, and
// those that may be hidden are compared with it. Included once for each instruction set.
#if defined(XCALIB_HIDDEN_ROW_INL_) == defined(HWY_TARGET_TOGGLE)
#ifdef XCALIB_HIDDEN_ROW_INL_
#undef XCALIB_HIDDEN_ROW_INL_
#else
#define XCALIB_HIDDEN_ROW_INL_
#endif

#include <algorithm>
#include <cstring>

#include "register/locate-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace xcalib {
namespace HWY_NAMESPACE {
namespace {

// Places along a row are in cells. Beyond all of them, and further still from pixel to pixel, are
// those of pixels that have none: these neither come back nor are passed.
constexpr double kFarthestPlace = 2097152, kNoPlace = 2 * kFarthestPlace;  // 2^21
constexpr float kFirstNoPlace = static_cast<float>(kNoPlace);
// Neighbours less than this apart may hide one another. [cells]
constexpr double kMinStep = 0.5;

class HiddenRow {
   public:
    // Nothing may be asked of it but what may be hidden where the task has no row of cells.
    HWY_INLINE HiddenRow(const RowsTask& task, int width)
        : grid_(task.row_grid), tolerance_(task.grid), room_(task.hidden),
          vectors_((width + kLanes - 1) / kLanes) {}

    // The points of the vector that begins at pixel x; `along` is the column of each.
    HWY_INLINE void put(int x, Float u_or_v, Float inverse_z, Mask somewhere, Float along) {
        const FloatTag d;
        const Float at = hn::MulAdd(u_or_v, hn::Set(d, grid_->per_pixel), hn::Set(d, grid_->shift));
        const Float held = hn::Min(hn::Max(at, set(-kFarthestPlace)), set(kFarthestPlace));
        hn::Store(hn::IfThenElse(somewhere, held, hn::Add(along, set(kNoPlace))), d,
                  room_->place.data() + x);
        hn::Store(inverse_z, d, room_->inverse_z.data() + x);
    }
    HWY_INLINE void put(int x, const Points& p, Mask somewhere, Float along) {
        put(x, grid_->along_u ? p.u : p.v, p.inverse_z, somewhere, along);
    }

    // When all have been put. Is there any that may be hidden?
    HWY_INLINE bool find() {
        const FloatTag d;
        const int end = vectors_ * kLanes;
        hn::Store(hn::Add(hn::Iota(d, static_cast<float>(end)), set(kNoPlace)), d,
                  room_->place.data() + end);
        const int breaks = find_breaks();
        any_ = breaks > 0;
        if (!any_) return false;
        std::memset(room_->role.data(), 0, vectors_);
        find_roles(find_runs(breaks));
        splat();
        return true;
    }

    HWY_INLINE bool may_be_hidden(int x) const {
        return any_ && room_->role.data()[x / kLanes] & kHidden;
    }

    // Of those that may be: the pixels of the vector that begins at x that something hides.
    HWY_INLINE Mask hidden(int x) const {
        const FloatTag d;
        const Float place = hn::Load(d, room_->place.data() + x);
        const Float inverse_z = hn::Load(d, room_->inverse_z.data() + x);
        // A silhouette lies anywhere between the last pixel on it and the first beside it: half a
        // cell to both sides is searched.
        const Int cell = to_cell(hn::Sub(place, set(0.5)));
        const Float nearest = hn::BitCast(d, nearest_at(cell));
        const Float bound = hn::MulAdd(inverse_z, set(1.0 + tolerance_->relative_tolerance),
                                       hn::Set(d, tolerance_->absolute_tolerance));
        return hn::And(hn::Gt(nearest, bound), is_place(place));
    }

   private:
    enum Role : std::uint8_t { kComesBack = 1, kIsPassed = 2, kBoth = 3 };
    // Near points are written, far ones compared.
    HWY_INLINE std::uint8_t hider() const { return grid_->near_lies_back ? kComesBack : kIsPassed; }
    static constexpr std::uint8_t kHidden = 4;

    static HWY_INLINE Mask is_place(Float place) {  // false for NaN
        return hn::Lt(place, hn::Set(FloatTag(), kFirstNoPlace));
    }

    HWY_INLINE Int to_cell(Float place) const {
        const Float first = set(double{RowGrid::kBefore}), last = set(grid_->count - 1.0);
        // Not negative, so that what is cut off is the fraction.
        return hn::ConvertTo(IntTag(), hn::Min(hn::Max(place, first), last));
    }

    // Vectors in which, or behind which, some place does not lie ahead of the one before.
    HWY_INLINE int find_breaks() {
        const FloatTag d;
        const float* HWY_RESTRICT place = room_->place.data();
        std::int32_t* HWY_RESTRICT breaks = room_->breaks.data();
        int count = 0;
        for (int i = 0; i < vectors_; ++i) {
            const float* at = place + i * kLanes;
            const Float step = hn::Sub(load(at + 1), hn::Load(d, at));
            breaks[count] = i;
            count += !hn::AllTrue(d, hn::Ge(step, set(kMinStep)));
        }
        return count;
    }

    // Vectors whose places lie each ahead of the one before; or one in which that is not so.
    HWY_INLINE int find_runs(int breaks) {
        HiddenRoom::Run* runs = room_->runs.data();
        int count = 0, next = 0;
        for (int i = 0; i <= breaks; ++i) {
            const int broken = i < breaks ? room_->breaks.data()[i] : vectors_;
            if (next < broken) runs[count++] = whole_run(next, broken - 1);
            if (broken < vectors_) runs[count++] = broken_run(broken);
            next = broken + 1;
        }
        return count;
    }

    HWY_INLINE HiddenRoom::Run whole_run(int first, int last) const {
        const float *begin = room_->place.data() + first * kLanes,
                    *end = room_->place.data() + (last + 1) * kLanes;
        // Those without a place come last.
        if (end[-1] >= kFirstNoPlace) end = std::lower_bound(begin, end, kFirstNoPlace);
        if (begin == end) return {first, last, 2 * kFirstNoPlace, -kFirstNoPlace};
        return {first, last, *begin, end[-1]};
    }

    HWY_INLINE HiddenRoom::Run broken_run(int vector) {
        const FloatTag d;
        const Float place = hn::Load(d, room_->place.data() + vector * kLanes);
        const Mask is = is_place(place);
        const Float low = hn::IfThenElse(is, place, set(2 * kNoPlace));
        const Float high = hn::IfThenElse(is, place, set(-kNoPlace));
        if (!hn::AllFalse(d, is)) room_->role.data()[vector] = kBoth | kHidden;
        return {vector, vector, hn::GetLane(hn::MinOfLanes(d, low)),
                hn::GetLane(hn::MaxOfLanes(d, high))};
    }

    // From run to run: at the start of a run vectors come back over what lies before it, at its
    // end they are passed by what follows.
    HWY_INLINE void find_roles(int runs) {
        const HiddenRoom::Run* run = room_->runs.data();
        std::uint8_t* role = room_->role.data();
        const float* place = room_->place.data();
        const auto step = static_cast<float>(kMinStep);
        const std::uint8_t back = kComesBack | (grid_->near_lies_back ? 0 : kHidden);
        const std::uint8_t passed = kIsPassed | (grid_->near_lies_back ? kHidden : 0);
        float before = -kFirstNoPlace, after = 2 * kFirstNoPlace;
        for (int i = 0; i < runs; ++i) {
            for (int v = run[i].first; v <= run[i].last; ++v) {
                if (place[v * kLanes] - before >= step) break;
                role[v] |= back;
            }
            before = std::max(before, run[i].high);
        }
        for (int i = runs - 1; i >= 0; --i) {
            for (int v = run[i].last; v >= run[i].first; --v) {
                const float end = place[(v + 1) * kLanes - 1];
                if (end >= kFirstNoPlace && place[v * kLanes] >= kFirstNoPlace) continue;
                if (end < kFirstNoPlace && after - end >= step) break;
                role[v] |= passed;
            }
            after = std::min(after, run[i].low);
        }
    }

    HWY_INLINE void splat() {
        std::memset(room_->cells.data(), 0, grid_->room() * sizeof(Nearness));
        const std::uint8_t* role = room_->role.data();
        const std::uint8_t wanted = hider();
        // Of two at one place the nearer is written later.
        if (grid_->near_lies_back) {
            for (int v = 0; v < vectors_; ++v)
                if (role[v] & wanted) splat(v);
        } else {
            for (int v = vectors_ - 1; v >= 0; --v)
                if (role[v] & wanted) splat(v);
        }
    }

    HWY_INLINE void splat(int vector) {
        const FloatTag d;
        const IntTag di;
        const Float place = hn::Load(d, room_->place.data() + vector * kLanes);
        const Float inverse_z = hn::Load(d, room_->inverse_z.data() + vector * kLanes);
        const Mask is = is_place(place);
        const Int cell = to_cell(place);
        const Int near = hn::ShiftRight<16>(hn::BitCast(di, inverse_z));
        Nearness* cells = room_->cells.data();
        HWY_ALIGN std::int32_t at[kLanes];
        HWY_ALIGN Nearness nearness[kLanes];
        hn::Store(cell, di, at);
        hn::Store(hn::DemoteTo(ShortTag(), near), ShortTag(), nearness);
        // Usually from cell to cell: all are written at once if this moves none by more than one.
        const Int start = hn::Sub(cell, hn::Iota(di, 0));
        const int first = at[kLanes / 2] - kLanes / 2;
        const Int off = hn::Abs(hn::Sub(start, set(first)));
        if (hn::AllTrue(d, hn::And(is, hn::RebindMask(d, hn::Lt(off, set(2)))))) {
            hn::StoreU(hn::Load(ShortTag(), nearness), ShortTag(), cells + first);
            return;
        }
        HWY_ALIGN std::int32_t known[kLanes];
        hn::Store(hn::VecFromMask(di, hn::RebindMask(di, is)), di, known);
        for (int i = 0; i < kLanes; ++i) {
            const int lane = grid_->near_lies_back ? i : kLanes - 1 - i;
            if (known[lane]) cells[at[lane]] = nearness[lane];
        }
    }

    // What is nearest in these cells and the ones behind them, as the upper half of a float.
    HWY_INLINE Int nearest_at(Int cell) const {
        const IntTag di;
        const Nearness* cells = room_->cells.data();
        HWY_ALIGN std::int32_t at[kLanes];
        hn::Store(cell, di, at);
#if HWY_TARGET != HWY_SCALAR
        const int first = at[kLanes / 2] - kLanes;
        const Int index = hn::Sub(cell, set(first));
        if (hn::AllTrue(di, hn::Eq(hn::AndNot(set(2 * kLanes - 1), index), hn::Zero(di))))
            return nearest_in_window(cells + first, 1, index);
#endif
        HWY_ALIGN std::int32_t nearest[kLanes];
        for (int i = 0; i < kLanes; ++i)
            nearest[i] = std::max(cells[at[i]], cells[at[i] + 1]) << 16;
        return hn::Load(di, nearest);
    }

    const RowGrid* grid_;
    const CellGrid* tolerance_;
    HiddenRoom* room_;
    int vectors_;
    bool any_ = false;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif
