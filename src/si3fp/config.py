"""Every constant of the method, named, with unit and source.

"paper" is the SI3FP paper; "decision" is a choice of this project (docs/decisions). Constants that
were chosen while looking at a particular scene say so.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class CollectConfig:
    """S.1: which panoramas are used."""

    min_panoramas: int = 15  # per building; paper: 15-40 per facade, one date where enough
    max_distance_m: float = 60.0  # decision: farther panoramas resolve windows too coarsely
    max_pixels: int = 16384 * 8192  # paper: the largest panorama; our decoding limit


@dataclass(frozen=True, slots=True)
class CaptureConfig:
    """C.1: when a photo must be taken again and when photos hang together."""

    max_pixels: int = 16384 * 8192  # our decoding limit
    work_side_px: int = 2400  # decision: longer side for sharpness; the paper's stills have 4 MP
    sharp_px: float = 0.4  # decision: blur of a sharp photo; in-camera sharpening makes it 0
    blurred_px: float = 0.8  # decision: above the sharp photos is blurred (at work_side_px)
    blurred_factor: float = 2.0  # decision: and this many times as much
    soft_px: float = 0.4  # decision: above the sharp photos: look at it
    soft_set_px: float = 1.5  # decision: median of all photos
    max_white: float = 0.2  # decision: share without detail, sky left out
    max_black: float = 0.5  # decision
    doubtful_share: float = 0.1  # decision: black or white without detail
    min_pixels: int = 400_000  # decision: a window of 1.4 m has 10 px on a wall 80 m wide
    good_pixels: int = 1_500_000  # decision; the paper's stills have 4 million
    min_photos: int = 3  # a point seen by three is checked by the third
    min_neighbours: int = 3  # decision
    good_number: int = 20  # decision: photos of one building
    twin_moved: float = 0.01  # decision: share of the longer side by which the picture moved
    twin_share: float = 0.5  # decision: share of the photo that repeats
    listed_weak_links: int = 5  # decision: more are a chain
    match_side_px: int = 800  # decision: longer side for the overlap
    max_features: int = 1000  # decision
    ratio: float = 0.8  # Lowe (2004), doi:10.1023/B:VISI.0000029664.99615.94
    inlier_px: float = 1.5  # decision: distance to the epipolar line at match_side_px
    min_matches: int = 20  # decision: an epipolar geometry takes 8 of any points
    min_agreeing: float = 0.35  # decision: share of the matches that one motion explains
    all_pairs_up_to: int = 60  # photos; decision
    coarse_features: int = 200  # decision: the largest, to choose pairs among many photos
    best_partners: int = 15  # decision: pairs kept of each of many photos
    followers: int = 3  # decision: photos that follow in order are always matched


@dataclass(frozen=True, slots=True)
class SfmConfig:
    """C.2: structure from motion."""

    mapper: str = "incremental"  # or "global": faster on hundreds of photos, less robust
    max_side_px: int = 1600  # decision: features are sought at this size; larger is no better
    max_features: int = 8192  # per photo; COLMAP's default
    threads: int = 4  # decision: at most; each takes about 0.5 GB while it seeks features
    mapper_threads: int = 1  # decision: with more the poses do not repeat bit for bit
    all_pairs_up_to: int = 60  # photos; decision
    followers: int = 10  # decision: photos that follow in order are matched, the ring closed
    near_photos: int = 10  # decision: nearest by GPS that are matched
    near_m: float = 30.0  # decision: and how far away they may be
    min_matches: int = 15  # COLMAP's default: fewer verified matches of a pair do not count
    min_model_photos: int = 3  # a point seen by three is checked by the third
    principal_point_photos: int = 10  # decision: of one camera, before its principal point moves
    principal_gain: float = 0.005  # decision: least share by which that lowers the error
    max_principal_shift: float = 0.03  # decision: of the longer side; the castle's: 0.6 %
    adjustments: int = 20  # decision: iterations of the last adjustment; 15 are enough
    same_view_deg: float = 15.0  # decision: SIFT matches a wall seen from directions so near
    same_view_ratio: float = 1.5  # decision: and from distances so alike
    same_place: float = 0.03  # decision: of the distance to the points; photos nearer share all
    stranger_share: float = 0.3  # decision: of the common points; correct models: 0.62 and up
    stranger_of_usual: float = 0.6  # decision: of the usual share; correct models: 0.78 and up
    min_strangers: int = 3  # decision: pairs; one may have a van before the lens
    strangers_of_neighbours: float = 0.05  # decision: least share of the pairs side by side
    most_folds: int = 3  # decision: that are taken apart, one after the other
    enough_strangers: float = 0.8  # decision: of them, parted by photos that are left out
    stray: float = 10.0  # decision: a photo so many times farther away than most is misplaced
    agree_share: float = 1 / 600  # decision: of the longer side, error of a match; 4 px in 2400
    strong_matches: int = 100  # decision: two correct models rejected 41 and 21 at most


@dataclass(frozen=True, slots=True)
class ClusterConfig:
    """S.2: Algorithm 2 and the robust default."""

    paper_offset_weight: float = 0.01  # per metre; paper, equation 1
    paper_threshold: float = 1e-5  # paper
    horizontal_normal: float = 0.5  # |n . up| above this is ground or roof; format
    min_pixels: int = 20  # decision: smaller plane segments are noise
    max_distance_m: float = 60.0  # decision: farther wall points and cameras do not count
    max_obliqueness_deg: float = 72.0  # decision: as for the views; panoramas without plane map
    angle_deg: float = 10.0  # decision: plane to footprint edge
    offset_m: float = 1.5  # decision: plane to footprint edge (map, GNSS and plane error)
    cluster_angle_deg: float = 4.0  # decision: planes of one wall without footprint
    cluster_offset_m: float = 0.6  # decision: planes of one wall without footprint
    gap_m: float = 3.0  # decision: a larger gap splits coplanar walls
    member_offset_sigma_m: float = 0.2  # decision: plane at the camera's foot (pose and plane)
    member_bearing_sigma_deg: float = 0.5  # decision: plane bearing (pose and plane)
    edge_offset_sigma_m: float = 0.5  # decision: footprint edge as a whole
    edge_corner_sigma_m: float = 0.2  # decision: its corners against each other
    min_agreeing: int = 3  # decision: panoramas that must agree before the edge is moved
    min_width_m: float = 1.0  # decision: shorter footprint edges are no facades
    default_height_m: float = 9.0  # decision: eaves where neither footprint nor planes tell
    camera_height_m: float = 2.5  # decision: above ground, where nothing tells the ground
    cloud_points: int = 600_000  # decision: coloured points of a run, 15 bytes each


@dataclass(frozen=True, slots=True)
class WorldConfig:
    """C.2: from a reconstruction to metres, z up, place and north."""

    tape_sigma_m: float = 0.02  # decision (METHOD 13): accuracy of a measured distance
    gps_sigma_m: float = 3.0  # decision: accuracy of a coordinate by a telephone's GPS
    max_scale_sigma: float = 1 / 3  # decision: of the scale; GPS over a shorter way tells none
    max_scale_factor: float = 1.5  # decision: between distances and GPS; more is a mistake
    max_heading_sigma_deg: float = 10.0  # decision: a north less sure than this is unknown
    min_fit: float = 0.6  # decision: score of walls on footprints near the place by GPS
    max_footprint_distance_m: float = 200.0  # decision: farther from the photos is elsewhere
    camera_height_m: float = 1.6  # decision: of hand-held cameras above the ground
    min_high_m: float = 3.0  # decision: points so far below tell of a drone or upper floor
    wall_tolerance: float = 0.01  # decision: of a wall's points, share of the typical distance
    unscaled_distance_m: float = 15.0  # decision: typical camera to wall where no scale is known
    max_lean_deg: float = 10.0  # decision: known cameras whose z leans more are not z up


@dataclass(frozen=True, slots=True)
class OrthoConfig:
    """Algorithms 1 and 3: the common grid of a facade."""

    m_per_px: float = 0.02  # decision; coarser where the images are
    margin_m: float = 1.0  # decision: beyond the prior box to the left, right and below
    headroom_m: float = 2.5  # decision: above the prior eaves, which may be mapped too low
    max_obliqueness_deg: float = 72.0  # decision: viewing angle to the facade normal
    min_seen: float = 0.05  # decision: share of the facade that a view must cover
    max_views: int = 40  # paper: 15-40 panoramas per facade
    band_px: int = 256  # rows resampled at once


@dataclass(frozen=True, slots=True)
class RadianceConfig:
    """C.3: the radiance field; tuned on the synthetic facade of benchmarks/accuracy/radiance."""

    m_per_px: float = 0.02  # finest cell of the field = pixel of the orthophoto
    slab_behind_m: float = 0.5  # decision: deepest recess that is rendered
    slab_front_m: float = 1.7  # decision: deepest balcony
    margin_m: float = 0.3  # decision: the field goes on beyond the rectangle
    min_standoff_m: float = 2.0  # decision: photos nearer to the plane or behind it are left out
    min_seen: float = 0.01  # decision: share of the wall that a photo must show
    max_photos: int = 60  # decision: those that show the wall best
    min_photos_to_hold_out: int = 8  # decision: fewer are all needed for training
    photos_mib: int = 512  # memory for pixels; more are averaged down
    entries_per_px: float = 0.6  # decision: rows per level of the hash table and ortho pixel
    max_log2_entries: int = 21  # 2 M rows x 6 levels x 64 bytes = 0.8 GiB
    front_levels: int = 4  # decision: trees and cars use the coarse levels
    front_cell_m: float = 0.16  # decision: occupancy of the front
    front_step_m: float = 0.12  # decision: distance between samples in the front
    cell_px: float = 2.0  # decision: occupancy of the slab, in ortho pixels
    near_share: float = 0.25  # decision: a ray is empty for this share of its way to the wall
    relief_m: float = 0.3  # decision: mouldings; what stands farther out is near a point
    seed_radius_m: float = 0.5  # decision: how near
    front_density_per_m: float = 0.2  # decision: where a field starts from
    slab_density_per_m: float = 0.05  # decision
    plane_rise: float = 2.0  # decision: log density that the plane starts above the slab
    plane_rise_m: float = 0.05  # decision: half width of that rise
    batch_samples: int = 65536  # at most; small walls take smaller batches
    samples_per_px: float = 150.0  # decision: budget per ortho pixel
    budget_s: float = 600.0  # upper limit; where it binds, a run depends on the machine
    learning_rate: float = 3e-2  # of features and photo gains
    network_rate: float = 1e-2
    decay_from: float = 0.5  # decision: share of the budget after which rates fall
    final_rate: float = 0.03  # decision: to this share
    first_step_px: float = 5.0  # decision: samples are this far apart at first
    step_px: float = 0.75  # METHOD: at most 1.5 cm at 2 cm per pixel
    shorten_until: float = 0.2
    huber: float = 0.1  # decision: colour errors above this count linearly (0..1)
    spread_weight: float = 0.01  # decision: cost of density in two places, per metre; late
    stand_off_weight: float = 0.005  # decision: cost of standing in front of the plane, likewise
    prune_from: float = 0.06  # share of the budget after which empty cells are skipped
    prune_growth: float = 1.3  # and again each time the training is this much longer
    keep: float = 0.4  # decision: of the densest value seen in a cell, each time
    forget: float = 0.97  # decision: of that, per sample that falls into the cell
    min_opacity: float = 0.015  # decision: a cell is empty where a sample absorbs less than this
    held_out_pixels: int = 20_000
    converged_db: float = 0.05  # decision: less gain over a fifth of the budget is none
    before_surface_m: float = 0.10  # decision: a surface does not hide itself
    threads: int = 2


@dataclass(frozen=True, slots=True)
class AlignConfig:
    """S.3: registration of the views of one facade."""

    m_per_px: float = 0.05  # decision
    best_views: int = 12  # decision: registered all against all
    ratio: float = 0.8  # Lowe (2004), doi:10.1023/B:VISI.0000029664.99615.94
    max_features: int = 2000
    inlier_px: float = 2.0  # at m_per_px
    min_inliers: int = 12  # decision
    max_shift_m: float = 1.5  # decision: prior on pose errors; repetitive windows lie farther apart
    match_sigma_m: float = 0.03  # decision: accuracy of a SIFT match at m_per_px
    position_sigma_m: float = 0.15  # decision: GNSS error of one panorama
    direction_sigma_deg: float = 0.3  # decision: orientation error of one panorama


@dataclass(frozen=True, slots=True)
class FacadeBoxConfig:
    """S.4: Algorithm 4."""

    m_per_px: float = 0.05  # decision: lines are sought at this resolution
    angle_deg: float = 10.0  # paper
    min_length_m: float = 0.5  # decision
    relevant_views: int = 2  # paper: seen in several views
    relevant_distance_m: float = 0.15  # decision: one line in several views
    iterations: int = 2000  # decision; the paper does not say
    cell_m: float = 1.0  # decision: lines of both directions so near together are structure
    min_size_m: float = 2.0  # decision: smaller boxes are no facades
    area_weight: float = 0.5  # decision: cost of the share of the area that a box takes
    side_weight: float = 0.6  # decision: worth of sides that lie on lines
    prior_weight: float = 0.1  # decision: per unit of log density
    min_support: float = 0.2  # decision: share of a side on lines, else the prior is kept
    overhang_m: float = 0.8  # decision: gutters and cornices appear this far above the wall's end
    overhang_support: float = 0.7  # decision: share of the eaves on a line that replaces them
    dbscan_eps_m: float = 0.3  # decision: votes of views on one line
    edge_sigma_m: float = 0.5  # decision: accuracy of a footprint edge as a prior
    ground_sigma_m: float = 0.3  # decision: accuracy of the ground as a prior
    eaves_sigma_m: float = 1.5  # decision: accuracy of the mapped height as a prior


@dataclass(frozen=True, slots=True)
class PlaneConfig:
    """C.2: facades from the sparse points."""

    min_views: int = 3  # photos that saw a point; decision: the third checks the other two
    max_error_px: float = 1.5  # decision: residual of a point; usual is 0.3 to 0.8
    min_angle_deg: float = 2.0  # decision: width of its bundle of rays
    inlier_m: float = 0.1  # decision: point to plane; noise is 0.02 to 0.05, walls lean 0.5 degrees
    cell_m: float = 0.5  # decision: support is counted in cells, not in points
    seed_rows: int = 4  # decision: cells above one another that make a place a wall
    seed_radius_m: float = 4.0  # decision: neighbourhood that proposes a line
    seed_step_deg: float = 2.0  # decision
    gap_m: float = 4.0  # decision: plain plaster may have no points for so long
    parallel_deg: float = 10.0  # decision: walls that hide one another rather than meet
    step_m: float = 4.0  # decision: deepest bay or set-back of one wall
    min_step_m: float = 0.25  # decision: smaller ones are relief, or a bent reconstruction
    min_rows: float = 1.5  # decision: rows of cells below which a place counts as empty
    relief_m: float = 0.5  # decision: frames, sills and plinths stand no farther off their wall
    relief_share: float = 0.4  # decision: of their places in which they may have more rows than it
    change_rows: float = 8.0  # decision: rows of cells that pay for a change of plane
    min_points: int = 40  # decision: on a facade
    min_flat: float = 0.4  # decision: share of the points within relief_m that lie on the plane
    min_photos: int = 3  # decision: that look at a facade
    min_width_m: float = 2.5  # decision: smaller walls are returns, piers and chimneys
    min_height_m: float = 2.0  # decision
    max_bottom_m: float = 4.5  # decision: what starts higher above the ground hides behind another
    max_distance_m: float = 60.0  # decision: windows are too coarse on farther walls
    corner_m: float = 1.0  # decision: walls that end so near their intersection meet there
    regular_deg: float = 2.0  # decision: turns from a right angle that count as errors
    regular_sigma_deg: float = 0.5  # decision: of right angles as built
    edge_angle_deg: float = 10.0  # decision: plane to footprint edge
    edge_offset_m: float = 1.5  # decision: plane to footprint edge
    camera_height_m: float = 1.6  # decision: of a camera held at the eye
    default_height_m: float = 9.0  # decision: of a building of which nothing tells the eaves


@dataclass(frozen=True, slots=True)
class MosaicConfig:
    """C.3, photos blended on the facade's plane; visibility also serves the radiance field."""

    max_views: int = 20  # decision
    photos_per_place: int = 6  # decision: the best vote; the castle's court was looked at
    min_gain: float = 0.002  # decision: a photo that adds less to the facade's worth is left out
    max_obliqueness_deg: float = 72.0  # decision: viewing angle to the facade normal
    min_seen: float = 0.02  # decision: share of the facade that a photo must show
    min_photos: int = 2  # decision: what fewer photos see is masked
    clearance_m: float = 0.5  # decision: what stands so near before the wall belongs to it
    point_reach_m: float = 0.4  # decision: around its place on the wall, standard deviation
    min_points: float = 1.5  # decision: a single point may be a wrong match
    wall_point_weight: float = 2.0  # decision: points before the wall that one on it outweighs


@dataclass(frozen=True, slots=True)
class FusionConfig:
    """M.1: Algorithm 6."""

    min_score: float = 0.2  # paper
    group_iou: float = 0.3  # paper
    min_views: int = 2  # paper; counted in views, not detections (decision)
    min_merged_score: float = 0.4  # paper; can never reject after min_score (docs/decisions)
    max_views: int = 12  # decision: the views with the largest coverage are searched
    min_mean_score: float = 0.0  # mean score over all views that saw the place; 0 = off


@dataclass(frozen=True, slots=True)
class MeasureConfig:
    """M.1: from boxes to windows in metres."""

    refine: bool = True
    search_m: float = 0.35  # decision: how far an edge may move inwards or outwards
    box_sigma_m: float = 0.08  # decision: how far a detected side lies off, standard deviation
    own_sigma_m: float = 0.06  # decision: how far one window's side lies off its like
    mullion_m: float = 0.12  # decision: widest post between lights of one opening
    infer: bool = True  # add windows where rows and columns want one and nobody could see
    min_completed: float = 0.7  # decision: least probability of a window that they add
    assumed_recess_m: float = 0.12  # decision: typical reveal where the depth is unknown
    recess_sigma_m: float = 0.06  # decision: uncertainty of that assumption
    correct_recess: bool = True
    measure_recess: bool = True  # decision: by parallax where views allow (docs/decisions/0008)
    recess_m_per_px: float = 0.04  # decision: views are compared at this resolution or coarser
    recess_max_views: int = 10  # decision: those with the widest spread of directions
    recess_min_views: int = 3  # decision: two cannot outvote a reflection
    recess_min_spread: float = 0.3  # decision: baseline over distance at the window
    recess_min_peak: float = 0.08  # decision: rise of the correlation above its low tenth
    recess_max_width_m: float = 0.20  # decision: half width of a peak; blunter ones tell nothing
    recess_floor_m: float = 0.02  # decision: systematic error of a measured recess
    door_sill_m: float = 0.4  # decision: what starts below this above the ground
    door_height_m: float = 1.7  # and is taller than this is a door or gate, not a window
    min_size_m: float = 0.25  # decision: smaller boxes are vents and noise


@dataclass(frozen=True, slots=True)
class ThermalConfig:
    """M.2: the thermal model."""

    country: str = "SE"
    default_year: int = 1970  # decision: used and reported where the footprint has no year
    storey_height_m: float = 3.0  # decision: used where storeys are unknown
    tolerance_m: float = 0.01  # honeybee's model tolerance
    inset_m: float = 0.02  # decision: least distance of an aperture to the wall's edge


@dataclass(frozen=True, slots=True)
class StreetConfig:
    """The StreetView path."""

    seed: int = 0
    collect: CollectConfig = field(default_factory=CollectConfig)
    cluster: ClusterConfig = field(default_factory=ClusterConfig)
    ortho: OrthoConfig = field(default_factory=OrthoConfig)
    align: AlignConfig = field(default_factory=AlignConfig)
    facade_box: FacadeBoxConfig = field(default_factory=FacadeBoxConfig)
    fusion: FusionConfig = field(default_factory=FusionConfig)
    measure: MeasureConfig = field(default_factory=MeasureConfig)
    thermal: ThermalConfig = field(default_factory=ThermalConfig)

    def as_dict(self) -> dict[str, Any]:
        """Nested plain values, as written into every JSON of a run."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class PhotoConfig:
    """The Camera2D path."""

    seed: int = 0
    renderer: str = "mosaic"  # decision; or "radiance": a field with depth
    sfm: SfmConfig = field(default_factory=SfmConfig)
    world: WorldConfig = field(default_factory=WorldConfig)
    planes: PlaneConfig = field(default_factory=PlaneConfig)
    mosaic: MosaicConfig = field(default_factory=MosaicConfig)
    radiance: RadianceConfig = field(default_factory=RadianceConfig)
    ortho: OrthoConfig = field(default_factory=OrthoConfig)
    facade_box: FacadeBoxConfig = field(default_factory=FacadeBoxConfig)
    mapped_eaves_sigma_m: float = 0.4  # decision: eaves where map and points agree
    fusion: FusionConfig = field(default_factory=FusionConfig)
    measure: MeasureConfig = field(default_factory=MeasureConfig)
    thermal: ThermalConfig = field(default_factory=ThermalConfig)

    def as_dict(self) -> dict[str, Any]:
        """Nested plain values, as written into every JSON of a run."""
        return asdict(self)


RunConfig = StreetConfig | PhotoConfig
