//! The calls of PROJ's C interface.
//!
//! A [`Transformation`] owns its PROJ context, so it may move between threads but not be shared. A
//! [`Pool`] gives a transformation to each thread and makes more as needed. Network access is off.
//! PROJ's log is silent: its messages are in the errors. The axis order is longitude, latitude and
//! east, north.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt;
use std::ptr;
use std::sync::{Mutex, PoisonError};

use proj_sys::{
    PJ, PJ_CONTEXT, PJ_DIRECTION, PJ_DIRECTION_PJ_FWD, PJ_DIRECTION_PJ_INV, PJ_LOG_LEVEL_PJ_LOG_NONE,
    PJ_TYPE_PJ_TYPE_BOUND_CRS, PJ_TYPE_PJ_TYPE_COMPOUND_CRS, PJ_TYPE_PJ_TYPE_GEOCENTRIC_CRS,
    PJ_TYPE_PJ_TYPE_GEOGRAPHIC_2D_CRS, PJ_TYPE_PJ_TYPE_GEOGRAPHIC_3D_CRS, PJ_TYPE_PJ_TYPE_PROJECTED_CRS,
    PJ_TYPE_PJ_TYPE_VERTICAL_CRS, PJ_WKT_TYPE, PJ_WKT_TYPE_PJ_WKT1_GDAL, PJ_WKT_TYPE_PJ_WKT2_2019, proj_as_wkt,
    proj_context_create, proj_context_destroy, proj_context_errno, proj_context_errno_string,
    proj_context_get_database_path, proj_context_set_enable_network, proj_create, proj_create_compound_crs,
    proj_create_crs_to_crs_from_pj, proj_crs_demote_to_2D, proj_crs_get_coordinate_system, proj_crs_get_sub_crs,
    proj_crs_promote_to_3D, proj_cs_get_axis_count, proj_cs_get_axis_info, proj_destroy, proj_get_area_of_use,
    proj_get_id_auth_name, proj_get_id_code, proj_get_name, proj_get_source_crs, proj_get_type, proj_identify,
    proj_int_list_destroy, proj_list_destroy, proj_list_get, proj_list_get_count, proj_log_func, proj_log_level,
    proj_normalize_for_visualization, proj_trans_generic,
};

/// The definition of a transformation.
#[derive(Debug, Clone)]
pub(crate) enum Recipe {
    /// Between the horizontal parts of two CRSs.
    Horizontal { source: String, target: String },
    /// Between two CRSs with heights.
    Spatial { source: String, target: String },
    /// A pipeline in PROJ's syntax.
    Pipeline(String),
}

/// PROJ's code of an error that has no code of its own.
const PROJ_ERR_OTHER: c_int = 4096;

/// The direction of a transformation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Direction {
    Forward,
    Inverse,
}

impl Direction {
    fn raw(self) -> PJ_DIRECTION {
        match self {
            Self::Forward => PJ_DIRECTION_PJ_FWD,
            Self::Inverse => PJ_DIRECTION_PJ_INV,
        }
    }
}

/// Ignores a message of PROJ's log, which prints some messages at every log level.
unsafe extern "C" fn ignore(_data: *mut c_void, _level: c_int, _message: *const c_char) {}

/// A PROJ context. It must be destroyed after the objects made in it.
pub(crate) struct Context(*mut PJ_CONTEXT);

impl Context {
    pub(crate) fn new() -> Self {
        // SAFETY: a fresh context, used by this value only; the calls only set flags on it.
        unsafe {
            let raw = proj_context_create();
            proj_log_level(raw, PJ_LOG_LEVEL_PJ_LOG_NONE);
            proj_log_func(raw, ptr::null_mut(), Some(ignore));
            proj_context_set_enable_network(raw, 0);
            Self(raw)
        }
    }

    /// The context for calls of PROJ, valid as long as this value.
    pub(crate) fn raw(&self) -> *mut PJ_CONTEXT {
        self.0
    }

    /// Returns PROJ's message for the last failure.
    fn reason(&self) -> String {
        // SAFETY: the context is alive; the returned text belongs to it and is copied at once.
        let text = unsafe {
            match proj_context_errno(self.0) {
                // PROJ_ERR_OTHER has the text "Unknown error".
                0 | PROJ_ERR_OTHER => None,
                code => text_of(proj_context_errno_string(self.0, code)),
            }
        };
        text.unwrap_or_else(|| "PROJ does not know the system, or has no operation with the installed grids".to_owned())
    }

    /// Takes ownership of a PROJ object made in this context. A null pointer becomes PROJ's
    /// message.
    pub(crate) fn own(&self, raw: *mut PJ) -> Result<Object, String> {
        if raw.is_null() { Err(self.reason()) } else { Ok(Object(raw)) }
    }

    pub(crate) fn create(&self, definition: &str) -> Result<Object, String> {
        let text = CString::new(definition).map_err(|_| "the definition has a NUL character".to_owned())?;
        // SAFETY: context and text are alive during the call; the result is owned by `Object`.
        let made = self.own(unsafe { proj_create(self.0, text.as_ptr()) });
        made.map_err(|reason| if definition.starts_with("EPSG:") { self.why_no_code() } else { reason })
    }

    /// Returns why PROJ makes nothing of an EPSG code.
    fn why_no_code(&self) -> String {
        // SAFETY: the context is alive; the text belongs to it and is copied at once.
        match unsafe { text_of(proj_context_get_database_path(self.0)) } {
            Some(_) => "PROJ's database has no such EPSG code".to_owned(),
            None => {
                "PROJ does not find its database, proj.db: PROJ_DATA, if it is set, must list its folder".to_owned()
            }
        }
    }

    /// Returns the two-dimensional horizontal part of a CRS.
    fn horizontal(&self, definition: &str) -> Result<Object, String> {
        let mut crs = self.create(definition)?;
        // SAFETY: all objects belong to this context and are alive; results are owned by `Object`.
        unsafe {
            if proj_get_type(crs.0) == PJ_TYPE_PJ_TYPE_COMPOUND_CRS {
                crs = self.own(proj_crs_get_sub_crs(self.0, crs.0, 0))?;
            }
            self.own(proj_crs_demote_to_2D(self.0, ptr::null(), crs.0))
        }
    }

    /// Returns how many metres (or radians) a unit of the first axis of a CRS has.
    fn unit_of_first_axis(&self, crs: &Object) -> Result<f64, String> {
        let mut factor = 0.0;
        // SAFETY: objects belong to the context and are alive; the one output pointer is valid, the
        // others may be null.
        let found = unsafe {
            let axes = self.own(proj_crs_get_coordinate_system(self.0, crs.0))?;
            let null = ptr::null_mut();
            proj_cs_get_axis_info(self.0, axes.0, 0, null, null, null, &mut factor, null, null, null)
        };
        if found == 0 { Err(self.reason()) } else { Ok(factor) }
    }

    /// Returns the EPSG code of a CRS: its own, else the code that PROJ recognises with at least 90
    /// % confidence.
    fn epsg(&self, crs: &Object) -> Option<u32> {
        // SAFETY: the object belongs to this context; texts are copied at once, lists are released
        // below.
        unsafe {
            if text_of(proj_get_id_auth_name(crs.0, 0)).as_deref() == Some("EPSG") {
                return text_of(proj_get_id_code(crs.0, 0))?.parse().ok();
            }
            let mut confidence = ptr::null_mut();
            let list = proj_identify(self.0, crs.0, c"EPSG".as_ptr(), ptr::null(), &mut confidence);
            if list.is_null() {
                return None;
            }
            let sure = proj_list_get_count(list) > 0 && !confidence.is_null() && *confidence >= 90;
            let best = sure.then(|| self.own(proj_list_get(self.0, list, 0)).ok()).flatten();
            proj_int_list_destroy(confidence);
            proj_list_destroy(list);
            text_of(proj_get_id_code(best?.0, 0))?.parse().ok()
        }
    }

    /// Returns the WKT2:2019 of a CRS.
    fn wkt2(&self, crs: &Object) -> Result<String, String> {
        // SAFETY: the object belongs to this context; no options are given; the text belongs to the
        // object and is copied at once.
        let text = unsafe { text_of(proj_as_wkt(self.0, crs.0, PJ_WKT_TYPE_PJ_WKT2_2019, ptr::null())) };
        text.ok_or_else(|| self.reason())
    }

    fn axis_count(&self, crs: &Object) -> Result<i32, String> {
        // SAFETY: objects belong to this context and are alive.
        unsafe {
            if proj_get_type(crs.0) == PJ_TYPE_PJ_TYPE_COMPOUND_CRS {
                return Ok(3);
            }
            let axes = self.own(proj_crs_get_coordinate_system(self.0, crs.0))?;
            Ok(proj_cs_get_axis_count(self.0, axes.0))
        }
    }

    /// Makes the best transformation between two CRSs. Ballpark transformations are refused,
    /// because their error is unknown.
    fn between(&self, source: &Object, target: &Object) -> Result<Object, String> {
        let options: [*const c_char; 2] = [c"ALLOW_BALLPARK=NO".as_ptr(), ptr::null()];
        // SAFETY: objects and options are alive; the option list ends with a null pointer.
        let raw =
            unsafe { proj_create_crs_to_crs_from_pj(self.0, source.0, target.0, ptr::null_mut(), options.as_ptr()) };
        let operation = self.own(raw)?;
        // SAFETY: the operation belongs to this context.
        self.own(unsafe { proj_normalize_for_visualization(self.0, operation.0) })
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: created by `proj_context_create`, destroyed once.
        unsafe { proj_context_destroy(self.0) };
    }
}

/// An owned PROJ object.
pub(crate) struct Object(*mut PJ);

impl Object {
    /// The object for calls of PROJ, valid as long as this value.
    pub(crate) fn raw(&self) -> *mut PJ {
        self.0
    }
}

impl Drop for Object {
    fn drop(&mut self) {
        // SAFETY: created by PROJ, destroyed once.
        unsafe { proj_destroy(self.0) };
    }
}

/// A coordinate transformation with its own context. Fields drop in order: the object before its
/// context.
pub(crate) struct Transformation {
    operation: Object,
    _context: Context,
}

// SAFETY: PROJ contexts and objects are not bound to a thread; they must only not be used by two
// threads at once. This value owns both, gives no reference to either, and needs `&mut self` to
// transform.
unsafe impl Send for Transformation {}

impl Transformation {
    /// Makes the transformation. The error is PROJ's message.
    pub(crate) fn new(recipe: &Recipe) -> Result<Self, String> {
        let context = Context::new();
        let operation = match recipe {
            Recipe::Horizontal { source, target } => {
                context.between(&context.horizontal(source)?, &context.horizontal(target)?)?
            }
            Recipe::Spatial { source, target } => {
                context.between(&context.create(source)?, &context.create(target)?)?
            }
            Recipe::Pipeline(definition) => context.create(definition)?,
        };
        Ok(Self { operation, _context: context })
    }

    /// Transforms in place and returns the number of points that failed. All their coordinates
    /// become NaN.
    ///
    /// The callers check that the slices have equal lengths. `z` may be empty.
    pub(crate) fn apply(&mut self, direction: Direction, x: &mut [f64], y: &mut [f64], z: &mut [f64]) -> usize {
        let n = x.len().min(y.len());
        let step = size_of::<f64>();
        let nz = if z.is_empty() { 0 } else { z.len().min(n) };
        let z_pointer = if nz == 0 { ptr::null_mut() } else { z.as_mut_ptr() };
        // SAFETY: each pointer is valid for its count of f64 with a stride of one f64. Absent
        // coordinates are null with count 0, which PROJ ignores.
        unsafe {
            proj_trans_generic(
                self.operation.0,
                direction.raw(),
                x.as_mut_ptr(),
                step,
                n,
                y.as_mut_ptr(),
                step,
                n,
                z_pointer,
                step,
                nz,
                ptr::null_mut(),
                0,
                0,
            );
        }
        mark_failures(x, y, z)
    }
}

/// Sets every point with a non-finite coordinate to NaN and counts them.
fn mark_failures(x: &mut [f64], y: &mut [f64], z: &mut [f64]) -> usize {
    let mut failed = 0;
    for i in 0..x.len().min(y.len()) {
        let height_fails = z.get(i).is_some_and(|h| !h.is_finite());
        if !x[i].is_finite() || !y[i].is_finite() || height_fails {
            failed += 1;
            x[i] = f64::NAN;
            y[i] = f64::NAN;
            if let Some(h) = z.get_mut(i) {
                *h = f64::NAN;
            }
        }
    }
    failed
}

/// Transformations of one recipe, for any number of threads.
pub(crate) struct Pool {
    recipe: Recipe,
    idle: Mutex<Vec<Transformation>>,
}

impl Pool {
    /// Makes a pool with one transformation, so that a recipe that cannot work fails here.
    pub(crate) fn new(recipe: Recipe) -> Result<Self, String> {
        let first = Transformation::new(&recipe)?;
        Ok(Self { recipe, idle: Mutex::new(vec![first]) })
    }

    /// Makes another pool of the same recipe.
    pub(crate) fn duplicate(&self) -> Self {
        Self { recipe: self.recipe.clone(), idle: Mutex::new(Vec::new()) }
    }

    /// Transforms in place with a transformation that no other thread uses; see
    /// [`Transformation::apply`].
    pub(crate) fn apply(
        &self,
        direction: Direction,
        x: &mut [f64],
        y: &mut [f64],
        z: &mut [f64],
    ) -> Result<usize, String> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut transformation = idle.map_or_else(|| Transformation::new(&self.recipe), Ok)?;
        let failed = transformation.apply(direction, x, y, z);
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(transformation);
        Ok(failed)
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Pool").field(&self.recipe).finish()
    }
}

/// The EPSG codes found in a CRS.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Codes {
    pub(crate) name: String,
    pub(crate) horizontal: Option<u32>,
    pub(crate) vertical: Option<u32>,
    /// Whether the CRS has a height axis, above its ellipsoid.
    pub(crate) three_dimensional: bool,
}

/// Returns the EPSG code of a whole CRS, if PROJ recognises it.
pub(crate) fn code_of(definition: &str) -> Option<u32> {
    let context = Context::new();
    let crs = context.create(definition).ok()?;
    context.epsg(&crs)
}

/// Finds the codes of a CRS.
pub(crate) fn codes(definition: &str) -> Result<Codes, String> {
    let context = Context::new();
    let mut crs = context.create(definition)?;
    // SAFETY: all objects belong to this context and are alive; results are owned by `Object`.
    unsafe {
        if proj_get_type(crs.0) == PJ_TYPE_PJ_TYPE_BOUND_CRS {
            crs = context.own(proj_get_source_crs(context.0, crs.0))?;
        }
        let name = text_of(proj_get_name(crs.0)).unwrap_or_default();
        let (mut ground, mut vertical) = (context.own(proj_crs_demote_to_2D(context.0, ptr::null(), crs.0))?, None);
        let is_compound = proj_get_type(crs.0) == PJ_TYPE_PJ_TYPE_COMPOUND_CRS;
        if is_compound {
            ground = context.own(proj_crs_get_sub_crs(context.0, crs.0, 0))?;
            let height = context.own(proj_crs_get_sub_crs(context.0, crs.0, 1))?;
            vertical = context.epsg(&height);
        }
        let axes = context.axis_count(&crs)?;
        Ok(Codes {
            name,
            horizontal: context.epsg(&ground),
            vertical,
            // A compound CRS whose vertical part has no code has heights above something else.
            three_dimensional: !is_compound && axes == 3,
        })
    }
}

/// Returns the WKT2:2019 of a CRS. With `promote`, an ellipsoidal height axis is added.
pub(crate) fn wkt(definition: &str, promote: bool) -> Result<String, String> {
    written(definition, promote, PJ_WKT_TYPE_PJ_WKT2_2019, &[])
}

/// Returns the WKT1 of a CRS. With `promote`, an ellipsoidal height axis is added, which WKT1 names
/// as the vertical part of a compound CRS.
pub(crate) fn wkt1(definition: &str, promote: bool) -> Result<String, String> {
    let options = [c"MULTILINE=NO", c"ALLOW_ELLIPSOIDAL_HEIGHT_AS_VERTICAL_CRS=YES"];
    written(definition, promote, PJ_WKT_TYPE_PJ_WKT1_GDAL, &options)
}

/// Returns the WKT2:2019 of the horizontal part of a CRS.
pub(crate) fn horizontal_wkt(definition: &str) -> Result<String, String> {
    let context = Context::new();
    let crs = context.horizontal(definition)?;
    context.wkt2(&crs)
}

/// Returns the WKT2:2019 of the compound CRS of a horizontal and a vertical one.
pub(crate) fn compound_wkt(horizontal: &str, vertical: &str) -> Result<String, String> {
    let context = Context::new();
    let (ground, heights) = (context.horizontal(horizontal)?, context.create(vertical)?);
    // SAFETY: all objects belong to this context and are alive; the names belong to them and are
    // copied at once; the result is owned by `Object`.
    let crs = unsafe {
        let [ground_name, height_name] =
            [&ground, &heights].map(|crs| text_of(proj_get_name(crs.0)).unwrap_or_default());
        let name = CString::new(format!("{ground_name} + {height_name}")).unwrap_or_default();
        context.own(proj_create_compound_crs(context.0, name.as_ptr(), ground.0, heights.0))?
    };
    context.wkt2(&crs)
}

fn written(definition: &str, promote: bool, form: PJ_WKT_TYPE, options: &[&CStr]) -> Result<String, String> {
    let context = Context::new();
    let mut crs = context.create(definition)?;
    let options: Vec<*const c_char> = options.iter().map(|text| text.as_ptr()).chain([ptr::null()]).collect();
    // SAFETY: all objects belong to this context and are alive; the list of options ends with null
    // and its texts outlive the call; the text belongs to `crs` and is copied at once.
    unsafe {
        if promote {
            crs = context.own(proj_crs_promote_to_3D(context.0, ptr::null(), crs.0))?;
        }
        let text = proj_as_wkt(context.0, crs.0, form, options.as_ptr());
        text_of(text).ok_or_else(|| context.reason())
    }
}

/// Copies a string of PROJ's.
///
/// # Safety
/// `text` must be null or a valid NUL-terminated string.
pub(crate) unsafe fn text_of(text: *const c_char) -> Option<String> {
    // SAFETY: the caller guarantees that a pointer other than null is a valid NUL-terminated
    // string.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}

/// Returns the bounds of the area of use of a CRS, degrees: west, south, east, north. `None` when
/// the registry names none.
pub(crate) fn area_of_use(definition: &str) -> Result<Option<[f64; 4]>, String> {
    let context = Context::new();
    let crs = context.create(definition)?;
    let [mut west, mut south, mut east, mut north] = [0.0; 4];
    // SAFETY: the object belongs to the context and is alive; the four pointers to numbers are
    // valid, and the pointer to the name may be null.
    let found = unsafe {
        proj_get_area_of_use(context.0, crs.0, &mut west, &mut south, &mut east, &mut north, ptr::null_mut())
    };
    // PROJ writes −1000 where a bound is not known.
    let bounds = [west, south, east, north];
    Ok((found != 0 && bounds.iter().all(|b| *b > -999.0)).then_some(bounds))
}

/// What a CRS can be used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CrsKind {
    Projected,
    Geographic,
    /// Three axes from the centre of the Earth.
    Geocentric,
    Vertical,
    Compound,
    Other,
}

/// Kind and name of a CRS. It is displayed as `a projected CRS (WGS 84 / UTM zone 31N)`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NamedKind {
    pub(crate) kind: CrsKind,
    name: String,
}

impl fmt::Display for NamedKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            CrsKind::Projected => "a projected",
            CrsKind::Geographic => "a geographic",
            CrsKind::Geocentric => "a geocentric",
            CrsKind::Vertical => "a vertical",
            CrsKind::Compound => "a compound",
            CrsKind::Other => "another kind of",
        };
        write!(f, "{kind} CRS ({})", self.name)
    }
}

/// Returns the kind and the name of a CRS.
pub(crate) fn named_kind(definition: &str) -> Result<NamedKind, String> {
    let context = Context::new();
    let crs = context.create(definition)?;
    // SAFETY: the object belongs to the context and is alive; the text belongs to it and is copied
    // at once.
    let (kind, name) = unsafe { (proj_get_type(crs.0), text_of(proj_get_name(crs.0)).unwrap_or_default()) };
    let kind = if kind == PJ_TYPE_PJ_TYPE_PROJECTED_CRS {
        CrsKind::Projected
    } else if kind == PJ_TYPE_PJ_TYPE_GEOGRAPHIC_2D_CRS || kind == PJ_TYPE_PJ_TYPE_GEOGRAPHIC_3D_CRS {
        CrsKind::Geographic
    } else if kind == PJ_TYPE_PJ_TYPE_GEOCENTRIC_CRS {
        CrsKind::Geocentric
    } else if kind == PJ_TYPE_PJ_TYPE_VERTICAL_CRS {
        CrsKind::Vertical
    } else if kind == PJ_TYPE_PJ_TYPE_COMPOUND_CRS {
        CrsKind::Compound
    } else {
        CrsKind::Other
    };
    Ok(NamedKind { kind, name })
}

/// Returns how many metres a unit of a vertical CRS has.
pub(crate) fn metres_per_vertical_unit(code: u32) -> Result<f64, String> {
    let context = Context::new();
    let crs = context.create(&format!("EPSG:{code}"))?;
    context.unit_of_first_axis(&crs)
}

/// Returns the metres per unit of a CRS's horizontal axes; `None` when the units are angles.
pub(crate) fn metres_per_unit(definition: &str) -> Result<Option<f64>, String> {
    let context = Context::new();
    let crs = context.horizontal(definition)?;
    let factor = context.unit_of_first_axis(&crs)?;
    // SAFETY: the object belongs to the context and is alive.
    let kind = unsafe { proj_get_type(crs.0) };
    let angular = kind == PJ_TYPE_PJ_TYPE_GEOGRAPHIC_2D_CRS || kind == PJ_TYPE_PJ_TYPE_GEOGRAPHIC_3D_CRS;
    Ok((!angular).then_some(factor))
}
