// What hides pixels where epipolar lines run nearly along the rows of the reference. Along a row
// the points of one surface lie one behind the other in the source; those that something nearer
// hides are passed by what follows, in their own row or in one that a line comes from. Only their
// vectors are compared with what was written to a row of cells for each row, in an order in which
// the nearest comes last. Included once for each instruction set.
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
// those of pixels that have none.
constexpr double kFarthestPlace = 2097152, kNoPlace = 2 * kFarthestPlace;  // 2^21
constexpr float kFirstNoPlace = static_cast<float>(kNoPlace);
// Neighbours in a row less than this apart may hide one another; of different rows, which depth
// that slopes shifts against each other, those that overlap by this. [cells]
constexpr float kMinStep = 0.5f, kMinOverlap = 2;
// From the row where something hides to where it does: to so much. [rows]
constexpr double kRowSlack = 0.75;

class HiddenRow {
   public:
    // Nothing may be called but may_be_hidden where the task has no row of cells. Rows come one
    // after another, up or down as the shadows fall.
    HWY_INLINE HiddenRow(const RowsTask& task, const Shadows& shadows, int width)
        : grid_(task.row_grid), tolerance_(task.grid), room_(task.hidden), shadows_(&shadows),
          width_(width), vectors_((width + kLanes - 1) / kLanes) {}

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

    // When all of a row, the `count`th that comes, have been put. Is there any that may be hidden?
    HWY_INLINE bool find(int count) {
        count_ = count;
        const FloatTag d;
        const int end = vectors_ * kLanes;
        hn::Store(hn::Add(hn::Iota(d, static_cast<float>(end)), set(kNoPlace)), d,
                  room_->place.data() + end);
        find_bounds();
        any_ = find_passed();
        splat();
        return any_;
    }

    HWY_INLINE bool may_be_hidden(int x) const { return any_ && room_->passed.data()[x / kLanes]; }

    // Of those that may be: the pixels of the vector that begins at x that something hides.
    HWY_INLINE Mask hidden(int x) const {
        const FloatTag d;
        const Float place = hn::Load(d, room_->place.data() + x);
        const Float inverse_z = hn::Load(d, room_->inverse_z.data() + x);
        const Float bound = hn::MulAdd(inverse_z, set(1.0 + tolerance_->relative_tolerance),
                                       hn::Set(d, tolerance_->absolute_tolerance));
        // A silhouette lies anywhere between the last pixel on it and the first beside it: half a
        // cell to both sides is searched.
        const Int cell = to_cell(hn::Sub(place, set(0.5)));
        Mask behind = hn::MaskFromVec(hn::Zero(d));
        const int rows = std::min(count_, shadows_->reach);
        const int band = x * Shadows::kBands / width_;
        const Float shortest = hn::Set(d, shadows_->shortest[band]);
        const Float longest = hn::Set(d, shadows_->longest[band]);
        for (int back = 0; back <= rows; ++back) {
            if (nearest_of(back) * shadows_->longest[band] + kRowSlack < back) continue;
            const Float nearest = hn::BitCast(d, nearest_at(cells_of_row(back), cell));
            const Float nearer = hn::Sub(nearest, inverse_z);
            // A line that something hides at comes from that row.
            const Mask from_there =
                hn::And(hn::Ge(hn::Mul(nearer, longest), set(back - kRowSlack)),
                        hn::Le(hn::Mul(nearer, shortest), set(back + kRowSlack)));
            behind = hn::Or(behind, hn::And(hn::Gt(nearest, bound), from_there));
        }
        return hn::And(behind, is_place(place));
    }

   private:
    static HWY_INLINE Mask is_place(Float place) {  // false for NaN
        return hn::Lt(place, hn::Set(FloatTag(), kFirstNoPlace));
    }

    HWY_INLINE Int to_cell(Float place) const {
        const Float first = set(double{RowGrid::kBefore}), last = set(grid_->count - 1.0);
        // Not negative, so that what is cut off is the fraction.
        return hn::ConvertTo(IntTag(), hn::Min(hn::Max(place, first), last));
    }

    // What is kept of the rows that came last.
    HWY_INLINE int slot(int back) const { return (count_ - back) % (shadows_->reach + 1); }
    HWY_INLINE Nearness* cells_of_row(int back) const {
        return room_->cells.data() + static_cast<std::size_t>(slot(back)) * grid_->room();
    }
    HWY_INLINE float* limits_of_row(int back) const {
        return room_->limits.data() + static_cast<std::size_t>(slot(back)) * room_->stride();
    }
    HWY_INLINE float& nearest_of(int back) const { return room_->nearest[slot(back)]; }

    // The lowest and the highest place of each vector, and whether within it, or next behind it,
    // a place does not lie ahead of the one before. Where the nearer of two surfaces lies ahead,
    // places are counted backwards, so that it lies back.
    HWY_INLINE void find_bounds() {
        const FloatTag d;
        const float* HWY_RESTRICT place = room_->place.data();
        float *low = room_->low.data(), *high = room_->high.data();
        for (int i = 0; i < vectors_; ++i) {
            const float* at = place + i * kLanes;
            const Float here = hn::Load(d, at);
            const bool whole =
                hn::AllTrue(d, hn::Ge(hn::Sub(load(at + 1), here), set(double{kMinStep})));
            float first = at[0], last = at[kLanes - 1];
            if (HWY_UNLIKELY(!whole || last >= kFirstNoPlace)) {
                const Mask is = is_place(here);
                const Float none = set(2 * kNoPlace);
                first = hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(is, here, none)));
                last = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElse(is, here, hn::Neg(none))));
            }
            room_->passed.data()[i] = !whole && first <= last;
            low[i] = grid_->near_lies_back ? first : -last;
            high[i] = grid_->near_lies_back ? last : -first;
        }
    }

    HWY_INLINE bool find_passed() {
        const int n = vectors_;
        std::uint8_t* passed = room_->passed.data();
        const float *low = room_->low.data(), *high = room_->high.data();
        float* limits = limits_of_row(0);
        float limit = 2 * kFirstNoPlace;
        bool any = false;
        for (int k = 0; k < n; ++k) {
            const int i = grid_->near_lies_back ? n - 1 - k : k;
            passed[i] |= limit - high[i] < kMinStep;
            any |= passed[i];
            limits[i] = limit;
            limit = std::min(limit, low[i]);
        }
        const int rows = std::min(count_, shadows_->reach);
        for (int back = 1; back <= rows; ++back) {
            if (nearest_of(back) * shadows_->longest_of_all + kRowSlack < back) continue;
            const float* from = limits_of_row(back);
            int more = 0;
            for (int i = 0; i < n; ++i) {
                const bool overlaps = from[i] - high[i] < -static_cast<float>(kMinOverlap);
                passed[i] |= overlaps;
                more |= overlaps;
            }
            any |= more != 0;
        }
        return any;
    }

    HWY_INLINE void splat() {
        const FloatTag d;
        Nearness* cells = cells_of_row(0);
        std::memset(cells, 0, grid_->room() * sizeof(Nearness));
        Float nearest = hn::Zero(d);
        const auto end = static_cast<float>(grid_->count);
        // Of two at one place the nearer is written later.
        for (int k = 0; k < vectors_; ++k) {
            const int i = grid_->near_lies_back ? k : vectors_ - 1 - k;
            const float low = room_->low.data()[i], high = room_->high.data()[i];
            const bool seen = grid_->near_lies_back ? high >= RowGrid::kBefore && low < end
                                                    : low <= -RowGrid::kBefore && high > -end;
            if (seen && low <= high) nearest = hn::Max(nearest, splat(i, cells));
        }
        nearest_of(0) = hn::GetLane(hn::MaxOfLanes(d, nearest));
    }

    // Returns how near the pixels of the vector are, 0 where nothing is.
    HWY_INLINE Float splat(int vector, Nearness* cells) const {
        const FloatTag d;
        const IntTag di;
        const Float place = hn::Load(d, room_->place.data() + vector * kLanes);
        const Mask is = is_place(place);
        const Float inverse_z =
            hn::IfThenElseZero(is, hn::Load(d, room_->inverse_z.data() + vector * kLanes));
        const Int cell = to_cell(place);
        const auto near = hn::DemoteTo(ShortTag(), hn::ShiftRight<16>(hn::BitCast(di, inverse_z)));
        // Usually from cell to cell: all are written at once if this moves none by more than one,
        // and they all move alike.
        const int first = to_cell_at(vector * kLanes + kLanes / 2) - kLanes / 2;
        const Int off = hn::Abs(hn::Sub(hn::Sub(cell, hn::Iota(di, 0)), set(first)));
        const bool alike = !room_->passed.data()[vector];
        if (alike && hn::AllTrue(d, hn::And(is, hn::RebindMask(d, hn::Lt(off, set(2)))))) {
            hn::StoreU(near, ShortTag(), cells + first);
            return inverse_z;
        }
        HWY_ALIGN std::int32_t at[kLanes];
        HWY_ALIGN Nearness nearness[kLanes];
        hn::Store(cell, di, at);
        hn::Store(near, ShortTag(), nearness);
        for (int i = 0; i < kLanes; ++i) {
            const int lane = grid_->near_lies_back ? i : kLanes - 1 - i;
            if (nearness[lane]) cells[at[lane]] = nearness[lane];
        }
        return inverse_z;
    }

    HWY_INLINE int to_cell_at(int x) const {
        const float place = std::min(room_->place.data()[x], grid_->count - 1.0f);
        return static_cast<int>(std::max(place, static_cast<float>(RowGrid::kBefore)));
    }

    // What is nearest in these cells and the ones behind them, as the upper half of a float.
    HWY_INLINE Int nearest_at(const Nearness* cells, Int cell) const {
        const IntTag di;
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
    const Shadows* shadows_;
    int width_, vectors_, count_ = 0;
    bool any_ = false;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace xcalib
HWY_AFTER_NAMESPACE();

#endif
