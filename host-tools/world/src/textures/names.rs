//! The 117 textures by name and group (PAPER Table 1).

/// Kinds of texture: the groups under the paper's Table 1.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Group {
    /// Paper-like materials.
    Paper,
    /// Art supplies and miscellaneous materials.
    Art,
    /// Types of glass.
    Glass,
    /// Types of foam.
    Foam,
    /// Tiles and laminates.
    Tile,
    /// Types of wood.
    Wood,
    /// Engineering materials.
    Engineering,
    /// Types of rubber.
    Rubber,
    /// Types of vinyl.
    Vinyl,
    /// Leathers and suedes.
    Leather,
    /// Cottons and silks.
    Cotton,
    /// Other fabrics and textiles.
    Fabric,
    /// Coarse weaves.
    Weave,
    /// Furs.
    Fur,
}

/// A texture's place in Table 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Named {
    /// Its number, 1..=117.
    pub number: u8,
    /// Its name.
    pub name: &'static str,
    /// The group it belongs to.
    pub group: Group,
}

const fn named(number: u8, name: &'static str, group: Group) -> Named {
    Named {
        number,
        name,
        group,
    }
}

/// All textures of Table 1, in its order and with its names.
#[rustfmt::skip]
pub const TEXTURES: [Named; 117] = {
    use Group::*;
    [
        named(1, "Computer paper", Paper),
        named(2, "Linen paper", Paper),
        named(3, "Smooth cardstock", Paper),
        named(4, "Marble cardstock", Paper),
        named(5, "Canvas cardstock", Paper),
        named(6, "Double mulberry paper", Paper),
        named(7, "Vellum", Paper),
        named(8, "Cardboard", Paper),
        named(9, "Foam board", Paper),
        named(10, "Velcro hooks", Art),
        named(11, "Velcro eyes", Art),
        named(12, "Acrylic felt", Art),
        named(13, "Polyester felt", Art),
        named(14, "Stiffened felt", Art),
        named(15, "Velvet paper", Art),
        named(16, "Canvas", Art),
        named(17, "Foam sheet", Art),
        named(18, "Plastic paper", Art),
        named(19, "Template plastic", Art),
        named(20, "Plastic mesh (5 mm)", Art),
        named(21, "Tarp", Art),
        named(22, "Corkboard", Art),
        named(23, "Carpet", Art),
        named(24, "Frosted glass", Glass),
        named(25, "Flemish glass", Glass),
        named(26, "Satin glass", Glass),
        named(27, "Frosty vue glass", Glass),
        named(28, "Textured glass", Glass),
        named(29, "Styrofoam", Foam),
        named(30, "Soft foam", Foam),
        named(31, "Very soft foam", Foam),
        named(32, "Marble", Tile),
        named(33, "Smooth tile", Tile),
        named(34, "Rough tile", Tile),
        named(35, "Natural stone laminate", Tile),
        named(36, "Oak wood", Wood),
        named(37, "Polished hickory", Wood),
        named(38, "Balsa wood", Wood),
        named(39, "Nylon plastic", Engineering),
        named(40, "PVC plastic", Engineering),
        named(41, "Acrylic", Engineering),
        named(42, "Graphite", Engineering),
        named(43, "Alumina graphite", Engineering),
        named(44, "Milled aluminum", Engineering),
        named(45, "Ground aluminum", Engineering),
        named(46, "Polished aluminum", Engineering),
        named(47, "Polyurethane rubber", Rubber),
        named(48, "Neoprene rubber", Rubber),
        named(49, "Nitrile rubber", Rubber),
        named(50, "Buna-N rubber", Rubber),
        named(51, "Santoprene rubber", Rubber),
        named(52, "Viton rubber", Rubber),
        named(53, "Haplon rubber", Rubber),
        named(54, "Silicone rubber", Rubber),
        named(55, "Plastic sheet", Vinyl),
        named(56, "Car vinyl", Vinyl),
        named(57, "Textured vinyl #1", Vinyl),
        named(58, "Textured vinyl #2", Vinyl),
        named(59, "PVC vinyl", Vinyl),
        named(60, "Snakeskin vinyl", Vinyl),
        named(61, "Lacquered vinyl", Vinyl),
        named(62, "Smooth vinyl", Vinyl),
        named(63, "Canvas vinyl", Vinyl),
        named(64, "Madrid vinyl", Vinyl),
        named(65, "Corinthian vinyl", Vinyl),
        named(66, "PVC snakeskin", Vinyl),
        named(67, "Coarse leather", Leather),
        named(68, "Medium-coarse leather", Leather),
        named(69, "Smooth leather", Leather),
        named(70, "Coarse suede", Leather),
        named(71, "Smooth suede", Leather),
        named(72, "Very soft suede", Leather),
        named(73, "Crepe de chine", Cotton),
        named(74, "Silk satin", Cotton),
        named(75, "Pimatex cotton", Cotton),
        named(76, "Cotton jersey", Cotton),
        named(77, "Cotton crush", Cotton),
        named(78, "Cotton interlock", Cotton),
        named(79, "Cotton lycra", Cotton),
        named(80, "Cotton velveteen", Cotton),
        named(81, "Coarse cotton", Cotton),
        named(82, "Soft cotton", Cotton),
        named(83, "Upholstery vinyl", Cotton),
        named(84, "Charmeuse satin", Fabric),
        named(85, "Cotton/silk blend", Fabric),
        named(86, "Lens-cleaning fabric", Fabric),
        named(87, "Rayon", Fabric),
        named(88, "Crushed satin", Fabric),
        named(89, "Raw silk", Fabric),
        named(90, "Crushed velvet", Fabric),
        named(91, "Corduroy", Fabric),
        named(92, "Silk velvet", Fabric),
        named(93, "Short-hair fur", Fabric),
        named(94, "Velboa", Fabric),
        named(95, "Terry cloth", Fabric),
        named(96, "Velour", Fabric),
        named(97, "Velvet", Fabric),
        named(98, "Viscose challis", Fabric),
        named(99, "Cotton sateen", Fabric),
        named(100, "Burlap", Weave),
        named(101, "Hand-woven cotton", Weave),
        named(102, "Cotton duck", Weave),
        named(103, "Bull denim", Weave),
        named(104, "Jean denim", Weave),
        named(105, "Denim twill", Weave),
        named(106, "Flannel", Weave),
        named(107, "Pineapple fiber weave", Weave),
        named(108, "Scenery canvas", Weave),
        named(109, "Silk noil", Weave),
        named(110, "Scenery muslin", Weave),
        named(111, "Linen cloth", Weave),
        named(112, "Cotton gauze", Weave),
        named(113, "Bamboo rayon", Weave),
        named(114, "Nylon fabric", Weave),
        named(115, "Hemp silk", Weave),
        named(116, "Rabbit fur", Fur),
        named(117, "Leopard shag", Fur),
    ]
};
