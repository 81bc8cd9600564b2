//! The 117 textures by name and group (PAPER Table 1).

use std::sync::LazyLock;

/// Kinds of texture: the groups under the paper's Table 1.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(crate) enum Group {
    Paper,
    Art,
    Glass,
    Foam,
    Tile,
    Wood,
    Engineering,
    Rubber,
    Vinyl,
    Leather,
    Cotton,
    Fabric,
    Weave,
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
    pub(crate) group: Group,
}

/// The names of Table 1 in its order, group by group.
#[rustfmt::skip]
const GROUPS: [(Group, &str); 14] = [
    (Group::Paper, "Computer paper; Linen paper; Smooth cardstock; Marble cardstock; Canvas cardstock; \
        Double mulberry paper; Vellum; Cardboard; Foam board"),
    (Group::Art, "Velcro hooks; Velcro eyes; Acrylic felt; Polyester felt; Stiffened felt; Velvet paper; Canvas; \
        Foam sheet; Plastic paper; Template plastic; Plastic mesh (5 mm); Tarp; Corkboard; Carpet"),
    (Group::Glass, "Frosted glass; Flemish glass; Satin glass; Frosty vue glass; Textured glass"),
    (Group::Foam, "Styrofoam; Soft foam; Very soft foam"),
    (Group::Tile, "Marble; Smooth tile; Rough tile; Natural stone laminate"),
    (Group::Wood, "Oak wood; Polished hickory; Balsa wood"),
    (Group::Engineering, "Nylon plastic; PVC plastic; Acrylic; Graphite; Alumina graphite; Milled aluminum; \
        Ground aluminum; Polished aluminum"),
    (Group::Rubber, "Polyurethane rubber; Neoprene rubber; Nitrile rubber; Buna-N rubber; Santoprene rubber; \
        Viton rubber; Haplon rubber; Silicone rubber"),
    (Group::Vinyl, "Plastic sheet; Car vinyl; Textured vinyl #1; Textured vinyl #2; PVC vinyl; Snakeskin vinyl; \
        Lacquered vinyl; Smooth vinyl; Canvas vinyl; Madrid vinyl; Corinthian vinyl; PVC snakeskin"),
    (Group::Leather, "Coarse leather; Medium-coarse leather; Smooth leather; Coarse suede; Smooth suede; \
        Very soft suede"),
    (Group::Cotton, "Crepe de chine; Silk satin; Pimatex cotton; Cotton jersey; Cotton crush; Cotton interlock; \
        Cotton lycra; Cotton velveteen; Coarse cotton; Soft cotton; Upholstery vinyl"),
    (Group::Fabric, "Charmeuse satin; Cotton/silk blend; Lens-cleaning fabric; Rayon; Crushed satin; Raw silk; \
        Crushed velvet; Corduroy; Silk velvet; Short-hair fur; Velboa; Terry cloth; Velour; Velvet; Viscose challis; \
        Cotton sateen"),
    (Group::Weave, "Burlap; Hand-woven cotton; Cotton duck; Bull denim; Jean denim; Denim twill; Flannel; \
        Pineapple fiber weave; Scenery canvas; Silk noil; Scenery muslin; Linen cloth; Cotton gauze; Bamboo rayon; \
        Nylon fabric; Hemp silk"),
    (Group::Fur, "Rabbit fur; Leopard shag"),
];

/// All textures of Table 1, in its order and with its names.
pub static TEXTURES: LazyLock<Vec<Named>> = LazyLock::new(|| {
    let names = GROUPS
        .iter()
        .flat_map(|&(group, names)| names.split("; ").map(move |name| (group, name)));
    let numbered = (1..).zip(names);
    numbered
        .map(|(number, (group, name))| Named {
            number,
            name,
            group,
        })
        .collect()
});
