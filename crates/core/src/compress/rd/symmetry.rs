//! Mesh symmetries of a tensor: the images of its entries, and the representatives of their orbits.
//!
//! Memory is a few bytes for each block. The image of a triangle is computed: a symmetry maps whole base triangles to
//! each other, and permutes the corners of all triangles within a base alike.

use super::shape::Shape;
use crate::domain::{Axis, Domain, Symmetry, TriangleMesh};

/// Permutations of a triangle's three corners, as orders of its four children: children 0, 1 and 2 are permuted alike,
/// child 3 stays.
const EXCHANGES: [[u8; 4]; 6] = [[0, 1, 2, 3], [0, 2, 1, 3], [1, 0, 2, 3], [1, 2, 0, 3], [2, 0, 1, 3], [2, 1, 0, 3]];
/// Tables of the six permutations of a triangle's corners. Each maps the path to a part of the triangle, over four
/// subdivision levels (four 2-bit child numbers), to the path after the permutation.
const FOUR_LEVELS: [[u8; 256]; 6] = four_levels();

const fn four_levels() -> [[u8; 256]; 6] {
    let mut tables = [[0; 256]; 6];
    let mut e = 0;
    while e < 6 {
        let mut path = 0;
        while path < 256 {
            let mut moved = 0;
            let mut digit = 0;
            while digit < 4 {
                moved |= EXCHANGES[e][path >> (2 * digit) & 3] << (2 * digit);
                digit += 1;
            }
            tables[e][path] = moved;
            path += 1;
        }
        e += 1;
    }
    tables
}

/// Images of the triangles of a domain under a symmetry, at any level.
#[derive(Clone, Debug)]
struct Moves {
    /// Image of each base triangle under a symmetry, and the number of the permutation of its corners.
    bases: Vec<(u8, u8)>,
}

impl Moves {
    /// Computes the images of the triangles of a domain (sphere or hemisphere) under a symmetry; `None` if these lie
    /// outside of the domain.
    fn of(symmetry: Symmetry, domain: Domain) -> Option<Self> {
        let children = symmetry.permutation(TriangleMesh::new(domain, 1)?)?;
        let base = |four: &[u32]| {
            let corners = EXCHANGES.iter().position(|e| e.iter().zip(four).all(|(&e, &to)| u32::from(e) == to % 4))?;
            Some(((four[0] / 4) as u8, corners as u8))
        };
        Some(Self { bases: children.chunks_exact(4).map(base).collect::<Option<_>>()? })
    }

    /// Image of triangle `t` in the mesh of `level`, at most 8, under the symmetry.
    #[inline]
    fn image(&self, level: u8, t: usize) -> usize {
        let below = 2 * u32::from(level);
        let (base, exchange) = self.bases[t >> below];
        let table = &FOUR_LEVELS[usize::from(exchange)];
        let moved = usize::from(table[t & 255]) | usize::from(table[t >> 8 & 255]) << 8;
        usize::from(base) << below | moved & ((1 << below) - 1)
    }

    /// Numbers (0 to 3) of the images of the four children of triangle `t` (its parts on the next finer level) under
    /// the symmetry. These images are children of the image of `t`.
    fn children(&self, level: u8, t: usize) -> [u8; 4] {
        EXCHANGES[usize::from(self.bases[t >> (2 * level)].1)]
    }
}

/// Returns all products of the symmetries `generators`, in the order of the domain's symmetries.
pub(super) fn closure(generators: &[Symmetry]) -> Vec<Symmetry> {
    let mut all = vec![Symmetry::IDENTITY];
    let mut next = 0;
    while next < all.len() {
        for generator in generators {
            let product = generator.after(all[next]);
            if !all.contains(&product) {
                all.push(product);
            }
        }
        next += 1;
    }
    all.sort();
    all
}

/// Group of mesh symmetries that permute the outgoing triangles (last triangle axis) and the blocks of a tensor. A
/// block is one entry on each of the other axes except the spectral one. The members are numbered, the identity first.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    mesh: TriangleMesh,
    /// Images of the outgoing triangles (last triangle axis of the tensor), for each symmetry of the group.
    leaves: Vec<Moves>,
    blocks: Vec<BlockAxis>,
}

/// Axis of a tensor that is neither the last triangle axis nor the last axis. If its entries are triangles, symmetries
/// permute them.
#[derive(Clone, Debug)]
struct BlockAxis {
    length: usize,
    /// Subdivision level of the triangle mesh, and images of its triangles under each member of the symmetry group;
    /// `None` if the entries of this axis are not triangles.
    moves: Option<(u8, Vec<Moves>)>,
}

impl Group {
    /// Builds the group of all products of the symmetries `generators` on a tensor. `None` if one of them maps a
    /// direction out of the sphere or hemisphere that a triangle axis covers.
    pub(crate) fn of(shape: &Shape, generators: &[Symmetry]) -> Option<Self> {
        Self::new(shape, &closure(generators))
    }

    /// Builds the group of the given symmetries of a tensor, the identity first. `None` if one of them maps a direction
    /// out of the sphere or hemisphere that a triangle axis covers.
    pub(super) fn new(shape: &Shape, symmetries: &[Symmetry]) -> Option<Self> {
        let moves = |domain| symmetries.iter().map(|&s| Moves::of(s, domain)).collect::<Option<Vec<_>>>();
        let axis = |axis: &Axis| {
            let moves = match axis {
                Axis::Triangles(mesh) => Some((mesh.level(), moves(mesh.domain())?)),
                _ => None,
            };
            Some(BlockAxis { length: axis.len(), moves })
        };
        let blocks = shape.block_axes().iter().map(axis).collect::<Option<_>>()?;
        Some(Self { mesh: shape.mesh(), leaves: moves(shape.mesh().domain())?, blocks })
    }

    /// Number of symmetries (rotations and reflections of the triangle mesh) in the group, the identity included.
    pub(crate) fn order(&self) -> usize {
        self.leaves.len()
    }

    /// Returns true if any member of the symmetry group may map a block (incoming direction) to another one.
    fn moves_blocks(&self) -> bool {
        self.order() > 1 && self.blocks.iter().any(|axis| axis.moves.is_some())
    }

    /// Number of the block (incoming direction) to which member `m` of the symmetry group maps a block.
    pub(crate) fn block(&self, m: usize, block: usize) -> usize {
        if m == 0 {
            return block;
        }
        let (mut rest, mut image, mut unit) = (block, 0, 1);
        for axis in self.blocks.iter().rev() {
            let own = rest % axis.length;
            rest /= axis.length;
            image += unit * axis.moves.as_ref().map_or(own, |(level, moves)| moves[m].image(*level, own));
            unit *= axis.length;
        }
        image
    }

    /// Number of the triangle to which member `m` of the symmetry group maps a triangle of the last triangle axis.
    #[inline]
    pub(crate) fn leaf(&self, m: usize, leaf: usize) -> usize {
        self.leaves[m].image(self.mesh.level(), leaf)
    }

    /// Number of the image of triangle `t` at subdivision level `level` under symmetry `m` of the group, and the
    /// numbers (0 to 3) that the images of its four children have in it.
    pub(crate) fn node(&self, m: usize, level: u8, t: usize) -> (usize, [u8; 4]) {
        (self.leaves[m].image(level, t), self.leaves[m].children(level, t))
    }

    /// Finds the first block of every orbit (blocks that the symmetries map to each other), in ascending order.
    pub(crate) fn representatives(&self) -> Representatives {
        let blocks: usize = self.blocks.iter().map(|axis| axis.length).product();
        if !self.moves_blocks() {
            let stabilisers = vec![Stabiliser { members: (0..self.order() as u8).collect(), leaders: vec![0] }];
            return Representatives { blocks: (0..blocks as u32).collect(), kinds: vec![0; blocks], stabilisers };
        }
        let mut found = Representatives { blocks: Vec::new(), kinds: Vec::new(), stabilisers: Vec::new() };
        let mut images = vec![0; self.order()];
        for block in 0..blocks {
            // Number of members checked until one maps the block to an earlier one.
            let mut known = 0;
            while known < images.len() {
                images[known] = self.block(known, block);
                if images[known] < block {
                    break;
                }
                known += 1;
            }
            if known == images.len() {
                found.push(block, &images);
            }
        }
        found
    }
}

/// Incoming directions that are coded, in ascending order. Of all those that the symmetries of the tensor map to each
/// other, only the first is coded.
#[derive(Clone, Debug)]
pub(crate) struct Representatives {
    blocks: Vec<u32>,
    /// For each coded block (incoming direction), number of its stabiliser, the symmetries that leave it in place.
    kinds: Vec<u8>,
    stabilisers: Vec<Stabiliser>,
}

/// Stabiliser: the symmetries of a group that leave a given block (incoming direction) in place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stabiliser {
    /// Indices, within the symmetry group, of the symmetries that map the block (incoming direction) to itself.
    pub(crate) members: Vec<u8>,
    /// Indices, within the symmetry group, of the first symmetry that maps the block (incoming direction) to each of
    /// its different images.
    pub(crate) leaders: Vec<u8>,
}

impl Representatives {
    fn push(&mut self, block: usize, images: &[usize]) {
        let is_member = |m: u8| images[usize::from(m)] == block;
        let kind = self.stabilisers.iter().position(|known| {
            let order = images.iter().filter(|&&image| image == block).count();
            known.members.len() == order && known.members.iter().all(|&m| is_member(m))
        });
        let kind = kind.unwrap_or_else(|| {
            let numbers = 0..images.len() as u8;
            let is_leader = |&m: &u8| !images[..usize::from(m)].contains(&images[usize::from(m)]);
            let leaders = numbers.clone().filter(is_leader).collect();
            self.stabilisers.push(Stabiliser { members: numbers.filter(|&m| is_member(m)).collect(), leaders });
            self.stabilisers.len() - 1
        });
        self.blocks.push(block as u32);
        self.kinds.push(kind as u8);
    }

    pub(crate) fn len(&self) -> usize {
        self.blocks.len()
    }

    /// Number, among all blocks (incoming directions), of the block that is coded as number `k`.
    pub(crate) fn block(&self, k: usize) -> usize {
        self.blocks[k] as usize
    }

    /// For each coded block (incoming direction), number of its stabiliser, the symmetries that leave it in place.
    pub(crate) fn kinds(&self) -> &[u8] {
        &self.kinds
    }

    /// All different stabilisers (sets of symmetries that leave an incoming direction in place) of the coded blocks.
    pub(crate) fn stabilisers(&self) -> &[Stabiliser] {
        &self.stabilisers
    }

    pub(crate) fn stabiliser(&self, k: usize) -> &Stabiliser {
        &self.stabilisers[usize::from(self.kinds[k])]
    }

    /// Number of the coded block (incoming direction) that represents a block, and of the symmetry that maps it to the
    /// block.
    pub(crate) fn of_block(&self, group: &Group, block: usize) -> Option<(usize, usize)> {
        let first = (0..group.order()).map(|m| group.block(m, block)).min()?;
        let k = self.blocks.binary_search(&(first as u32)).ok()?;
        let leader = self.stabiliser(k).leaders.iter().find(|&&m| group.block(usize::from(m), first) == block)?;
        Some((k, usize::from(*leader)))
    }

    /// For each block (incoming direction), numbers of the coded block that represents it and of the symmetry that maps
    /// it to the block.
    pub(crate) fn by_block(&self, group: &Group, blocks: usize) -> Vec<(u32, u8)> {
        let mut all = vec![(0, 0); blocks];
        for k in 0..self.len() {
            for &m in &self.stabiliser(k).leaders {
                all[group.block(usize::from(m), self.block(k))] = (k as u32, m);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(domain: Domain, level: u8) -> Axis {
        Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
    }

    #[test]
    fn images_are_those_of_the_lattice() {
        for &domain in Domain::ALL {
            for level in 0..=6 {
                let mesh = TriangleMesh::new(domain, level).unwrap();
                for symmetry in Symmetry::of(domain) {
                    let moves = Moves::of(symmetry, domain).unwrap();
                    let images = symmetry.permutation(mesh).unwrap();
                    assert!((0..mesh.len()).all(|t| moves.image(level, t) == images[t] as usize));
                }
            }
        }
        let mesh = TriangleMesh::new(Domain::Sphere, 8).unwrap();
        let symmetry = Symmetry::of(Domain::Sphere)[47];
        let moves = Moves::of(symmetry, Domain::Sphere).unwrap();
        let images = symmetry.permutation(mesh).unwrap();
        assert!((0..mesh.len()).step_by(7).all(|t| moves.image(8, t) == images[t] as usize));
        assert!(Moves::of(symmetry, Domain::Hemisphere).is_none());
    }

    #[test]
    fn representatives_stand_for_every_block_once() {
        let sphere = |level| mesh(Domain::Sphere, level);
        let some = |count| Axis::Index { count, labels: Vec::new() };
        for axes in [
            vec![some(3), sphere(2), sphere(1), some(2)],
            vec![sphere(1), some(2), sphere(0), sphere(1)],
            vec![some(5), sphere(1), some(3)],
            vec![mesh(Domain::Hemisphere, 2), mesh(Domain::Lower, 1), some(4)],
        ] {
            let shape = Shape::of(&axes).unwrap();
            let known = Symmetry::of(shape.mesh().domain());
            for generators in [vec![], vec![known[1]], vec![known[3], known[4]], known.clone()] {
                let group = Group::of(&shape, &generators).unwrap();
                let representatives = group.representatives();
                let mut times = vec![0; shape.blocks()];
                for k in 0..representatives.len() {
                    let (block, stabiliser) = (representatives.block(k), representatives.stabiliser(k));
                    assert_eq!(stabiliser.members.len() * stabiliser.leaders.len(), group.order());
                    assert!(stabiliser.members.iter().all(|&m| group.block(usize::from(m), block) == block));
                    for &m in &stabiliser.leaders {
                        times[group.block(usize::from(m), block)] += 1;
                    }
                }
                assert!(times.iter().all(|&times| times == 1));
                for (block, &(k, m)) in representatives.by_block(&group, shape.blocks()).iter().enumerate() {
                    assert_eq!(group.block(usize::from(m), representatives.block(k as usize)), block);
                    let found = representatives.of_block(&group, block);
                    assert_eq!(found, Some((k as usize, usize::from(m))));
                }
            }
        }
    }
}
